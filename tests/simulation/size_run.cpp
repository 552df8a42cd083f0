#include "simulation/size_run.hpp"

#include <memory>

#include "capture/sample_merger.hpp"
#include "detection/observe.hpp"
#include "estimation/checks/rejection_watch.hpp"

namespace fiducap {

namespace {

BodySensors sensors_of(const EstimationData& data) {
  BodySensors sensors;
  sensors.cameras = {data.camera};
  sensors.cameras.front().X_BV = data.nominal_X_BV;
  sensors.imu = data.imu;
  sensors.gravity_m_s2 = data.gravity_m_s2;
  return sensors;
}

class Runner {
 public:
  Runner(const EstimationData& data, const std::string& filter)
      : data_(data), check_(sensors_of(data), data.corner_noise_px) {
    EstimatorConfig config;
    config.corner_noise_px = data.corner_noise_px;
    filter_ =
        make_body_filter(filter, sensors_of(data), {data.reference_tag, std::nullopt}, config);
  }

  SizeRun run(int tag) {
    SampleMerger merger({.has_imu = data_.imu.has_value()});
    for (const SensorSample& sample : data_.samples) {
      merger.push(sample);
      while (const auto next = merger.pop()) take(*next, merger);
    }
    out_.tag = tag;
    out_.common = check_.common();
    out_.by_imu = check_.of_tag(tag, true);
    out_.by_others = check_.of_tag(tag, false);
    return out_;
  }

 private:
  void take(const SensorSample& sample, SampleMerger& merger) {
    if (const auto* imu = std::get_if<ImuSample>(&sample)) {
      filter_->propagate(*imu);
      check_.add(*imu);
      return;
    }
    const auto& corners = std::get<CornerFrame>(sample);
    observe(corners, data_.camera.model, data_.tag_set, {}, seen_);
    const UpdateReport report = filter_->update(seen_, {});
    merger.set_clock_shift(corners.camera,
                           shift_to_apply(filter_->clock(corners.camera), corners.clock_shift));
    out_.used += report.tags_used;
    out_.rejected += report.tags_rejected;
    const double t = to_seconds(seen_.exposed_at - time_of(data_.samples.front()));
    if (rejections_.add(report)) out_.rejection_said_at_s.push_back(t);
    if (!filter_->running()) return;
    filter_->tag_beliefs(beliefs_);
    check_.add({seen_, filter_->estimate(), report, beliefs_, {}});
    if (const auto news = check_.take_news()) out_.said.push_back({t, *news});
  }

  const EstimationData& data_;
  std::unique_ptr<BodyFilter> filter_;
  SizeCheck check_;
  RejectionWatch rejections_;
  TagObservations seen_;
  std::vector<TagBelief> beliefs_;
  SizeRun out_;
};

}  // namespace

SizeRun run_sizes(SimulatedDataSetup setup, const std::string& filter, const Misprint& misprint) {
  EstimationData data = simulate(setup);
  const int tag = most_seen_tag(data);
  if (misprint.fault) {
    misprint.fault(setup.faults, tag, setup.seconds);
    data = simulate(setup);
  }
  const double edge_m = data.tag_set.edge_of(tag);
  data.tag_set.size_m /= misprint.all;
  for (auto& [id, size_m] : data.tag_set.sizes_m) size_m /= misprint.all;
  if (misprint.one != 1) data.tag_set.sizes_m[tag] = edge_m / misprint.all / misprint.one;
  return Runner(data, filter).run(tag);
}

}  // namespace fiducap
