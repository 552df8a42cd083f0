// CPU per second of data (IMU 200 Hz, images 20 Hz) by the number of tags, through the pipeline.
#include <cmath>

#include "bench.hpp"
#include "estimation/options.hpp"
#include "pipeline/body_pipeline.hpp"
#include "tag_wall.hpp"

namespace fiducap::bench {

namespace {

constexpr int kMostInView = 10;
// A filter that is too slow for the table is stopped after so much CPU time.
constexpr int kFewestImages = 20;
constexpr double kEnough_s = 10.0;

struct Cost {
  double propagate_s{};  ///< Per second of data: taking in IMU readings.
  double update_s{};     ///< Moving the state over them to the images, and correcting it.
  std::size_t local_tags{};
};

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

/// One pipeline in front of the wall.
class Stand {
 public:
  Stand(const std::string& filter, int tags, bool mapped)
      : wall_(tags), tags_(tags), in_view_(std::min(tags, kMostInView)), mapped_(mapped) {
    PipelineSetup setup;
    setup.filter = filter;
    setup.sensors = wall_.sensors();
    setup.tags.size_m = Wall::kEdge_m;
    setup.gauge.reference_tag = 0;
    pipeline_.emplace(std::move(setup));
    TagMap map;
    if (mapped) map = wall_.map();
    map.reference_tag = 0;
    view_.map = std::make_shared<const TagMap>(std::move(map));
  }

  Cost measure(int images) {
    constexpr int kImagesToEnter = 50;
    for (int i = 0; i < kImagesToEnter; ++i) image(0);  // the motion starts
    for (int first = 0; first < tags_; first += in_view_) {
      for (int i = 0; i < (mapped_ ? 1 : kImagesToEnter); ++i) image(first);
    }
    propagate_s_.clear();
    update_s_.clear();
    const Duration begin = thread_cpu_time();
    for (int i = 0; i < images; ++i) {
      image(tags_ <= in_view_ ? 0 : (7 * i) % (tags_ - in_view_ + 1));
      if (i > kFewestImages && to_seconds(thread_cpu_time() - begin) > kEnough_s) break;
    }
    const double images_per_s = kImuRate_hz / kImuPerImage;
    return {images_per_s * median(propagate_s_), images_per_s * median(update_s_), local_tags_};
  }

 private:
  void image(int first) {
    const PipelineStatistics before = pipeline_->statistics();
    for (int i = 0; i < kImuPerImage; ++i) push(Wall::imu(k_++));
    push(wall_.photograph(k_ - 1, first, in_view_));
    const PipelineStatistics after = pipeline_->statistics();
    propagate_s_.push_back(to_seconds(after.propagate_cpu - before.propagate_cpu));
    update_s_.push_back(to_seconds(after.update_cpu - before.update_cpu));
  }

  void push(SensorSample sample) {
    (void)pipeline_->push(std::move(sample));
    while (pipeline_->next() != nullptr) {
      if (const BodyUpdate* update = pipeline_->take(view_)) local_tags_ = update->beliefs.size();
    }
  }

  Wall wall_;
  int tags_;
  int in_view_;
  bool mapped_;
  std::optional<BodyPipeline> pipeline_;
  MapView view_;
  std::size_t local_tags_{0};
  int k_{0};
  std::vector<double> propagate_s_;
  std::vector<double> update_s_;
};

/// The authors' code, -O2, its slots all filled; the last: its mode with a known map
/// (research/rcars_study.md).
struct Rcars {
  int tags;
  bool mapped;
  double predict_s, update_s;
};
constexpr Rcars kRcars[] = {{3, false, 0.0075, 0.0002},
                            {10, false, 0.054, 0.0027},
                            {20, false, 0.26, 0.013},
                            {40, false, 1.90, 0.056},
                            {100, true, 0.0073, 0.0023}};

double rcars_total(int tags, bool mapped) {
  for (const Rcars& one : kRcars) {
    if (one.tags == tags && one.mapped == mapped) return one.predict_s + one.update_s;
  }
  return Nees::kNone;
}

void add_rows(Table& table, const std::string& filter, const std::vector<int>& counts, bool mapped,
              int images) {
  double before_s = Nees::kNone;
  int before = 0;
  for (const int tags : counts) {
    const Cost cost = Stand(filter, tags, mapped).measure(images);
    const double total = cost.propagate_s + cost.update_s;
    const double slope = std::log(total / before_s) / std::log(static_cast<double>(tags) / before);
    const double authors = rcars_total(tags, mapped);
    table.rows.push_back({filter, mapped ? "mapped" : "local", std::to_string(tags),
                          std::to_string(cost.local_tags),
                          std::to_string(std::min(tags, kMostInView)), Figure{cost.propagate_s, 5},
                          Figure{cost.update_s, 5}, Figure{total, 5}, Figure{slope, 2},
                          Figure{authors, 4}, Figure{authors / total, 0}});
    before_s = total;
    before = tags;
  }
}

}  // namespace

std::vector<Table> bench_cpu(const EstimationOptions& options) {
  Table table{
      "CPU seconds per second of data: IMU 200 Hz, images 20 Hz (median image; this machine may be "
      "busy)",
      {"filter", "tags", "number", "in state", "in view", "propagate", "update", "total", "slope",
       "RCARS", "RCARS/ours"}};
  const int images = options.quick ? 60 : 400;
  for (const std::string& filter : options.filters) {
    add_rows(table, filter,
             options.quick ? std::vector{3, 10, 40} : std::vector{3, 10, 20, 40, 100}, false,
             images);
    add_rows(table, filter, options.quick ? std::vector{10, 100} : std::vector{10, 100, 1000}, true,
             images);
  }
  table.remarks.emplace_back(
      "propagate: taking in IMU readings; update: all that an image costs behind the detector. "
      "slope: "
      "exponent of the total between this row and the one above.");
  table.remarks.emplace_back(
      "mapped: tags come with the map's covariance, the view wanders over all of them. RCARS: -O2, "
      "220 predictions per s.");
  return {table};
}

}  // namespace fiducap::bench
