#include "calibration/extrinsics/loaded_samples.hpp"

#include <algorithm>
#include <utility>

#include "detection/tag_detector.hpp"

namespace fiducap {
namespace {

constexpr double kFast_s = 0.05;
constexpr double kSlow_s = 0.5;
constexpr double kRotating_rad_s = 0.5;
constexpr double kAccelerating_m_s2 = 1.0;
constexpr double kMaxGap_s = 0.25;

}  // namespace

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
      loaded.few.note(image->image);
      if (progress) progress(loaded.frames.size());
    } else {
      loaded.frames.push_back(std::move(std::get<CornerFrame>(**sample)));
    }
  }
  // Recordings may contain samples out of order.
  std::ranges::stable_sort(loaded.imu, {}, &ImuSample::sampled_at);
  std::ranges::stable_sort(loaded.frames, {}, &CornerFrame::exposed_at);
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

void StillnessDetector::add(const ImuSample& sample) {
  if (!sample.w_WB_B.allFinite() || !sample.f_B.allFinite()) return;
  const double step = to_seconds(sample.sampled_at - last_at_.value_or(sample.sampled_at));
  if (step < 0 || step > kMaxGap_s) *this = StillnessDetector();
  const double dt = last_at_ ? step : 0;
  last_at_ = sample.sampled_at;
  ++samples_;
  // Arithmetic means at first: a single reading is mostly noise.
  const double first = 1.0 / samples_;
  const double fast = std::max(first, dt / (kFast_s + dt));
  w_ += fast * (sample.w_WB_B - w_);
  f_ += fast * (sample.f_B - f_);
  slow_f_ += std::max(first, dt / (kSlow_s + dt)) * (sample.f_B - slow_f_);
  const bool still = w_.norm() < kRotating_rad_s && (f_ - slow_f_).norm() < kAccelerating_m_s2;
  still_s_ = still ? still_s_ + dt : 0;
}

std::optional<Instant> first_rest(const LoadedSamples& samples) {
  StillnessDetector detector;
  std::optional<Instant> began, newest_tag;
  auto frame = samples.frames.begin();
  for (const ImuSample& imu : samples.imu) {
    detector.add(imu);
    if (detector.still_s() == 0) began.reset();
    if (detector.still_s() > 0 && !began) began = imu.sampled_at;
    for (; frame != samples.frames.end() && frame->exposed_at <= imu.sampled_at; ++frame)
      if (!frame->tags.empty()) newest_tag = frame->exposed_at;
    if (began && detector.is_still() && newest_tag >= began) return began;
  }
  return std::nullopt;
}

}  // namespace fiducap
