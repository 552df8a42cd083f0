// Wrong tag sizes: whether the size check says so, of whom, when, and whether it keeps silent otherwise.
#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <mutex>

#include "capture/sample_merger.hpp"
#include "detection/observe.hpp"
#include "estimation/options.hpp"
#include "estimation/parallel.hpp"
#include "estimation/rejection_watch.hpp"
#include "estimation/tag_size/size_check.hpp"

namespace fiducap::bench {

namespace {

struct Misprint {
  std::string name;
  double all{1};  ///< printed / configured, of every tag
  double one{1};  ///< … and of the tag that is seen most, besides
  std::function<void(SimulatedDataSetup&, int tag)> fault{};
};

int most_seen(const EstimationData& data) {
  std::map<int, int> count;
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image == nullptr) continue;
    for (const TagSighting& tag : image->tags)
      if (tag.tag_id != data.reference_tag) ++count[tag.tag_id];
  }
  const auto most = std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == count.end() ? -1 : most->first;
}

std::vector<Misprint> misprints() {
  std::vector<Misprint> all{{"right"},
                            {"all 1.25", 1.25},
                            {"all 1.10", 1.10},
                            {"all 0.90", 0.90},
                            {"all 0.80", 0.80},
                            {"one 1.10", 1, 1.10},
                            {"one 0.90", 1, 0.90},
                            {"one 1.25", 1, 1.25}};
  all.push_back({"wrong ids", 1, 1, [](SimulatedDataSetup& s, int) { s.faults.wrong_id = 0.01; }});
  all.push_back({"covered", 1, 1, [](SimulatedDataSetup& s, int) { s.faults.occlude_corner = 0.1; }});
  all.push_back({"moved tag", 1, 1, [](SimulatedDataSetup& s, int tag) {
                   s.faults.moved_tag = tag;
                   s.faults.moved_at_s = 0.5 * s.seconds;
                   s.faults.moved_by_m = {0.2, 0.2, 0.1};
                 }});
  all.push_back({"+50 ms", 1, 1, [](SimulatedDataSetup& s, int) { s.faults.image_stamp_error_s = 0.05; }});
  all.push_back({"-50 ms", 1, 1, [](SimulatedDataSetup& s, int) { s.faults.image_stamp_error_s = -0.05; }});
  all.push_back({"IMU loss", 1, 1, [](SimulatedDataSetup& s, int) {
                   s.faults.drop_imu = 0.05;
                   s.faults.imu_stamp_jitter_s = 0.002;
                 }});
  all.push_back({"saturated", 1, 1, [](SimulatedDataSetup& s, int) {
                   s.faults.saturation_at_s = 0.5 * s.seconds;
                   s.faults.saturation_s = 3.0;
                 }});
  return all;
}

struct Said {
  double at_s{};
  SizeFinding what;
};

struct SizeRun {
  int tag{-1};
  std::vector<Said> said;
  std::vector<double> rejected_at_s;
  std::optional<LogScale> common;
  std::optional<LogScale> of_tag[2];
  double rejected{}, used{};
};

class Runner {
 public:
  Runner(const EstimationData& data, const std::string& filter, const EstimatorConfig& base) : data_(data) {
    BodySensors sensors;
    sensors.cameras = {data.camera};
    sensors.cameras.front().X_BV = data.nominal_X_BV;
    sensors.imu = data.imu;
    sensors.gravity_m_s2 = data.gravity_m_s2;
    EstimatorConfig config = base;
    config.corner_noise_px = data.corner_noise_px;
    filter_ = make_body_filter(filter, sensors, {data.reference_tag, std::nullopt}, config);
    check_ = std::make_unique<SizeCheck>(sensors, config.corner_noise_px);
  }

  SizeRun run() {
    SampleMerger merger({.has_imu = data_.imu.has_value()});
    for (const SensorSample& sample : data_.samples) {
      merger.push(sample);
      while (const auto next = merger.pop()) take(*next, merger);
    }
    out_.common = check_->common();
    return out_;
  }
  const SizeCheck& check() const { return *check_; }

 private:
  void take(const SensorSample& sample, SampleMerger& merger) {
    if (const auto* imu = std::get_if<ImuSample>(&sample)) {
      filter_->propagate(*imu);
      check_->add(*imu);
      return;
    }
    const auto& corners = std::get<CornerFrame>(sample);
    observe(corners, data_.camera.model, data_.tag_set, {}, seen_);
    const UpdateReport report = filter_->update(seen_, {});
    merger.set_clock_shift(corners.camera, shift_to_apply(filter_->clock(corners.camera), corners.clock_shift));
    out_.used += report.tags_used;
    out_.rejected += report.tags_rejected;
    const double t = to_seconds(seen_.exposed_at - time_of(data_.samples.front()));
    if (watch_.add(report)) out_.rejected_at_s.push_back(t);
    if (!filter_->running()) return;
    filter_->tag_beliefs(beliefs_);
    const BodyEstimate estimate = filter_->estimate();
    check_->add({seen_, estimate, report, beliefs_, {}});
    if (const auto news = check_->take_news()) out_.said.push_back({t, *news});
  }

  const EstimationData& data_;
  std::unique_ptr<BodyFilter> filter_;
  std::unique_ptr<SizeCheck> check_;
  RejectionWatch watch_;
  TagObservations seen_;
  std::vector<TagBelief> beliefs_;
  SizeRun out_;
};

SizeRun run_one(const EstimationOptions& options, const std::string& world, const std::string& filter, bool has_imu,
                const Misprint& misprint, std::uint64_t seed) {
  SimulatedDataSetup setup{.world = world, .seconds = seconds_of(options, world), .seed = seed, .has_imu = has_imu};
  EstimationData data = simulate(setup);
  const int tag = most_seen(data);
  if (misprint.fault) {
    misprint.fault(setup, tag);
    data = simulate(setup);
  }
  const double edge = data.tag_set.edge_of(tag);
  for (auto& [id, size] : data.tag_set.sizes_m) size /= misprint.all;
  data.tag_set.size_m /= misprint.all;
  if (misprint.one != 1) data.tag_set.sizes_m[tag] = edge / misprint.all / misprint.one;
  Runner runner(data, filter, options.estimator);
  SizeRun out = runner.run();
  out.tag = tag;
  out.of_tag[0] = runner.check().of_tag(tag, true);
  out.of_tag[1] = runner.check().of_tag(tag, false);
  return out;
}

std::string text(const std::optional<LogScale>& scale) {
  return scale ? fmt::format("{:.3f}±{:.3f}", std::exp(scale->value), scale->sigma) : "-";
}

}  // namespace

std::vector<Table> bench_sizes(const EstimationOptions& options) {
  Table table{fmt::format("Wrong tag sizes, {} seeds", options.seeds),
              {"class", "imu", "filter", "printed/told", "said rightly", "of all", "of one", "wrongly", "first s", "median ratio",
               "rejected %", "rejection said"}};
  for (const std::string& world : options.classes) {
    for (const bool has_imu : {true, false}) {
      for (const std::string& filter : options.filters) {
        for (const Misprint& misprint : misprints()) {
          if (!options.textures.empty() && options.textures.front() != "sharp" &&
              misprint.name.find(options.textures.front()) == std::string::npos)
            continue;
          if (!has_imu && misprint.fault && misprint.name != "wrong ids" && misprint.name != "moved tag" && misprint.name != "covered") continue;
          std::vector<SizeRun> runs(static_cast<std::size_t>(options.seeds));
          in_parallel(options.seeds, options.threads, [&](int i) {
            runs[static_cast<std::size_t>(i)] =
                run_one(options, world, filter, has_imu, misprint, options.first_seed + static_cast<std::uint64_t>(i));
          });
          int right = 0, all = 0, one = 0, wrong = 0, rejection = 0;
          double rejected = 0, judged = 0;
          std::vector<double> first, ratio;
          for (std::size_t i = 0; i < runs.size(); ++i) {
            const SizeRun& run = runs[i];
            bool ok = false, bad = false, to_all = false, to_one = false;
            for (const Said& said : run.said) {
              const double truth = !said.what.tag_id ? misprint.all : misprint.all * (*said.what.tag_id == run.tag ? misprint.one : 1.0);
              const bool is_right = std::abs(std::log(truth)) > 0.03 && std::log(truth) * std::log(said.what.ratio) > 0;
              if (is_right && !ok) {
                first.push_back(said.at_s);
                ratio.push_back(said.what.ratio);
              }
              (is_right ? ok : bad) = true;
              (said.what.tag_id ? to_one : to_all) = true;
            }
            right += ok;
            wrong += bad;
            all += to_all;
            one += to_one;
            rejection += !run.rejected_at_s.empty();
            rejected += run.rejected;
            judged += run.rejected + run.used;
            if (options.each) {
              fmt::print("{} {} {} seed {}: common {} tag {} imu {} others {}; rejected {:.0f} %;", world, has_imu, misprint.name, i + 1,
                         text(run.common), run.tag, text(run.of_tag[0]), text(run.of_tag[1]), 100 * run.rejected / (run.rejected + run.used));
              for (const Said& said : run.said) fmt::print(" [{:.0f} s {} {:.3f}]", said.at_s, said.what.tag_id.value_or(-1), said.what.ratio);
              for (double t : run.rejected_at_s) fmt::print(" <rej {:.0f}>", t);
              fmt::print("\n");
              std::fflush(stdout);
            }
          }
          const auto median = [](std::vector<double> v) {
            if (v.empty()) return Nees::kNone;
            std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
            return v[v.size() / 2];
          };
          table.rows.push_back({world, has_imu ? "yes" : "no", filter, misprint.name, std::to_string(right), std::to_string(all),
                                std::to_string(one), std::to_string(wrong), Figure{median(first), 0}, Figure{median(ratio), 3},
                                Figure{100 * rejected / judged, 1}, std::to_string(rejection)});
        }
      }
    }
  }
  return {table};
}

}  // namespace fiducap::bench
