#pragma once

#include <cstddef>
#include <vector>

#include "base/expected.hpp"
#include "capture/sensor_source.hpp"
#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// A recording in memory, its tags already found: it can be run again and again without reading or
/// detecting.
struct LoadedSamples {
  std::vector<ImuSample> imu;
  std::vector<CornerFrame> frames;  ///< By time; images were detected.
  long tags{};                      ///< Sightings in all frames together.
  bool begins_calm{};               ///< Who collected them has seen to that (CalmWatch).
};

/// Called now and then with the number of images done.
using LoadProgress = std::function<void(std::size_t images)>;

/// @return Error when the source is lost
[[nodiscard]] Expected<LoadedSamples> load_samples(const OfflineSetup& setup, SensorSource& source,
                                                   const LoadProgress& progress = {});

/// Gives the samples out by time, all images later by `shift` than they say; none from before
/// `begin`. Owns nothing.
class SampleReplay final : public SensorSource {
 public:
  SampleReplay(const LoadedSamples& samples, Duration shift, Instant begin = Instant::min());
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

 private:
  const LoadedSamples& samples_;
  Duration shift_;
  std::size_t imu_{0};
  std::size_t frame_{0};
};

}  // namespace fiducap
