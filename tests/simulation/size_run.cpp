#include "simulation/size_run.hpp"

#include <memory>

#include "estimation/checks/size_check.hpp"
#include "pipeline/body_pipeline.hpp"

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

/// Feeds a separate size check with the pipeline's images, so that its state is accessible.
SizeRun run_check(const EstimationData& data, const std::string& filter, int tag) {
  PipelineSetup setup;
  setup.sensors = sensors_of(data);
  setup.tags = data.tag_set;
  setup.estimator.corner_noise_px = data.corner_noise_px;
  setup.gauge.reference_tag = data.reference_tag;
  setup.filter = filter;
  BodyPipeline pipeline(setup);
  SizeCheck check(setup.sensors, data.corner_noise_px);
  RejectionWatch rejections;
  const MapView empty{std::make_shared<const TagMap>()};
  SizeRun out;
  const auto drain = [&] {
    while (const SensorSample* sample = pipeline.next()) {
      if (const auto* imu = std::get_if<ImuSample>(sample)) check.add(*imu);
      const BodyUpdate* update = pipeline.take(empty);
      if (update == nullptr) continue;
      out.used += update->report.tags_used;
      out.rejected += update->report.tags_rejected;
      const double t = to_seconds(update->seen.exposed_at - time_of(data.samples.front()));
      if (rejections.add(update->report)) out.rejection_said_at_s.push_back(t);
      if (!update->estimate) continue;
      check.add({update->seen, *update->estimate, update->report, update->beliefs, {}});
      if (const auto event = check.take_event()) out.said.push_back({t, *event});
    }
  };
  for (const SensorSample& sample : data.samples) {
    pipeline.push(sample);
    drain();
  }
  out.tag = tag;
  out.common = check.common();
  out.by_imu = check.of_tag(tag, true);
  out.by_others = check.of_tag(tag, false);
  return out;
}

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
  return run_check(data, filter, tag);
}

}  // namespace fiducap
