#include "calibration/extrinsics/sample_replay.hpp"

#include <algorithm>
#include <utility>

#include "detection/tag_detector.hpp"

namespace fiducap {

Expected<LoadedSamples> load_samples(const OfflineSetup& setup, SensorSource& source,
                                     const LoadProgress& progress) {
  LoadedSamples loaded;
  std::optional<TagDetector> detector;
  for (;;) {
    auto sample = source.next({});
    if (!sample) return tl::unexpected(sample.error());
    if (!sample->has_value()) break;
    if (const auto* imu = std::get_if<ImuSample>(&**sample)) {
      loaded.imu.push_back(*imu);
    } else if (const auto* image = std::get_if<CameraFrame>(&**sample)) {
      if (!detector) detector.emplace(setup.tags, setup.detector);
      loaded.frames.push_back(detector->detect(*image));
      if (progress) progress(loaded.frames.size());
    } else {
      loaded.frames.push_back(std::move(std::get<CornerFrame>(**sample)));
    }
  }
  // Recordings may hold samples out of order; what comes back in time again would be dropped
  // anyway.
  std::stable_sort(
      loaded.imu.begin(), loaded.imu.end(),
      [](const ImuSample& a, const ImuSample& b) { return a.sampled_at < b.sampled_at; });
  std::stable_sort(
      loaded.frames.begin(), loaded.frames.end(),
      [](const CornerFrame& a, const CornerFrame& b) { return a.exposed_at < b.exposed_at; });
  for (const CornerFrame& frame : loaded.frames)
    loaded.tags += static_cast<long>(frame.tags.size());
  return loaded;
}

SampleReplay::SampleReplay(const LoadedSamples& samples, Duration shift, Instant begin)
    : samples_(samples), shift_(shift) {
  while (imu_ < samples.imu.size() && samples.imu[imu_].sampled_at < begin) ++imu_;
  while (frame_ < samples.frames.size() && samples.frames[frame_].exposed_at + shift < begin)
    ++frame_;
}

Expected<std::optional<SensorSample>> SampleReplay::next(std::stop_token stop) {
  const bool imu_left = imu_ < samples_.imu.size();
  if (stop.stop_requested()) return std::nullopt;
  if (frame_ == samples_.frames.size() && !imu_left) return std::nullopt;
  const bool image =
      frame_ < samples_.frames.size() &&
      (!imu_left || samples_.frames[frame_].exposed_at + shift_ < samples_.imu[imu_].sampled_at);
  if (!image) return std::optional<SensorSample>(samples_.imu[imu_++]);
  CornerFrame frame = samples_.frames[frame_++];
  frame.exposed_at += shift_;
  return std::optional<SensorSample>(std::move(frame));
}

}  // namespace fiducap
