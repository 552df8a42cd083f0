// CPU per second of data (IMU 200 Hz, images 20 Hz) by the number of tags, through the pipeline.
#include <cmath>
#include <numeric>
#include <random>

#include "base/pose.hpp"
#include "base/process.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/options.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/body_pipeline.hpp"

namespace fiducap::bench {

namespace {

constexpr double kImuRate_hz = 200;
constexpr int kImuPerImage = 10;

/// A camera that sways in front of a wall with tilted tags, ten to a row; from the hundredth on
/// they are in the places of the first again. An image shows any of them.
class Wall final {
 public:
  static constexpr double kEdge_m = 0.2;
  static constexpr double kMargin = 60;

  explicit Wall(int tags) {
    camera_.model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
    Eigen::Matrix3d R_BV;  // camera z along body x
    R_BV << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    camera_.X_BV = {Eigen::Quaterniond(R_BV), {0.05, 0, 0}};
    Eigen::Matrix3d facing;  // tag z against x, tag y up
    facing << 0, 0, -1, -1, 0, 0, 0, 1, 0;
    for (int i = 0; i < tags; ++i) {
      const double y = 0.32 * (i % 10 - 4.5);
      const double z = 0.26 * (i / 10 % 10 - 4.5);
      const Eigen::Vector3d tilt(0.45 * std::sin(1.7 * i), 0.5 + 0.2 * std::cos(2.3 * i), 0.1 * i);
      X_WT_.push_back({Eigen::Quaterniond(facing) * exp_so3(tilt), {3, y, z}});
    }
  }

  [[nodiscard]] BodySensors sensors() const {
    return {{camera_}, ImuNoise{1.2e-4, 2e-5, 2.3e-3, 5e-4, kImuRate_hz}};
  }

  [[nodiscard]] static ImuSample imu(int k) {
    const double t = k / kImuRate_hz;
    const Eigen::Vector3d a =
        -sway().cwiseProduct(speed().cwiseProduct(speed())).cwiseProduct(sines(t));
    return {instant(t), Eigen::Vector3d::Zero(), a + Eigen::Vector3d(0, 0, 9.81)};
  }

  /// Image of `count` tags from number `first` on, at the instant of IMU sample k.
  [[nodiscard]] CornerFrame image(int k, int first, int count) {
    const double t = k / kImuRate_hz;
    CornerFrame frame{0, instant(t), {}};
    const Pose X_VW =
        (Pose{Eigen::Quaterniond::Identity(), sway().cwiseProduct(sines(t))} * camera_.X_BV)
            .inverse();
    for (int i = first; i < first + count && i < static_cast<int>(X_WT_.size()); ++i) {
      TagSighting tag;
      tag.tag_id = i;
      tag.decision_margin = kMargin;
      for (int c = 0; c < 4; ++c) {
        const auto corner = static_cast<std::size_t>(c);
        tag.corners_px[corner] = camera_.model.pinhole(
            X_VW * (X_WT_[static_cast<std::size_t>(i)] * tag_corner(c, kEdge_m)));
        tag.corners_px[corner] +=
            EstimatorConfig{}.corner_noise_px * Eigen::Vector2d(noise_(random_), noise_(random_));
      }
      frame.tags.push_back(tag);
    }
    return frame;
  }

  /// A settled map.
  [[nodiscard]] TagMap map() const {
    TagMap map;
    for (std::size_t i = 0; i < X_WT_.size(); ++i) {
      KnownTag known{static_cast<int>(i), kEdge_m, X_WT_[i], Matrix6d::Zero()};
      known.covariance.diagonal() << 1e-6, 1e-6, 1e-6, 4e-6, 4e-6, 4e-6;  // 1 mm, 2 mrad
      map.tags.push_back({known, TagState::kCalibrated, 0, 0, 0, 0});
    }
    return map;
  }

 private:
  static Instant instant(double t) { return instant_from_ns(0) + from_seconds(t); }
  static Eigen::Vector3d sway() { return {0.15, 0.2, 0.1}; }
  static Eigen::Vector3d speed() { return {1.3, 1.7, 2.1}; }
  static Eigen::Vector3d sines(double t) { return (speed() * t).array().sin(); }

  CameraMount camera_;
  std::vector<Pose> X_WT_;
  std::mt19937 random_{1};
  std::normal_distribution<double> noise_;
};

constexpr int kMostInView = 10;
// A slow filter is stopped after this CPU time.
constexpr int kFewestImages = 20;
constexpr double kEnough_s = 10.0;

struct Cost {
  double propagate_s{};  ///< Per second of data: of IMU samples.
  double update_s{};     ///< Propagation to the images, and update.
  std::size_t local_tags{};
};

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
    const double propagate_s = std::accumulate(propagate_s_.begin(), propagate_s_.end(), 0.0) /
                               static_cast<double>(propagate_s_.size());
    return {images_per_s * propagate_s, images_per_s * median(update_s_), local_tags_};
  }

 private:
  void image(int first) {
    const PipelineStatistics before = pipeline_->statistics();
    for (int i = 0; i < kImuPerImage; ++i) push(Wall::imu(k_++));
    push(wall_.image(k_ - 1, first, in_view_));
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
    table.rows.push_back(cells(filter, mapped ? "mapped" : "local", tags, cost.local_tags,
                               std::min(tags, kMostInView), Figure{cost.propagate_s, 5},
                               Figure{cost.update_s, 5}, Figure{total, 5}, Figure{slope, 2},
                               Figure{authors, 4}, Figure{authors / total, 0}));
    before_s = total;
    before = tags;
  }
}

}  // namespace

std::vector<Table> bench_cpu(const EstimationOptions& options) {
  Table table{
      "CPU seconds per second of data: IMU 200 Hz, images 20 Hz (median image; machine may be "
      "busy)",
      split("filter|tags|number|in state|in view|propagate|update|total|slope|RCARS|RCARS/ours")};
  const int images = options.quick ? 60 : 400;
  for (const std::string& filter : options.filters) {
    add_rows(table, filter,
             options.quick ? std::vector{3, 10, 40} : std::vector{3, 10, 20, 40, 100}, false,
             images);
    add_rows(table, filter, options.quick ? std::vector{10, 100} : std::vector{10, 100, 1000}, true,
             images);
  }
  table.remarks.emplace_back(
      "propagate: IMU samples; update: all costs of an image behind the detector. slope: exponent "
      "of the total between this row and the one above.");
  table.remarks.emplace_back(
      "mapped: tags come with the map's covariance, the view wanders over all of them. RCARS: -O2, "
      "220 predictions per s.");
  return {table};
}

}  // namespace fiducap::bench
