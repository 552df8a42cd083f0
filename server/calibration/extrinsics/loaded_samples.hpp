#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/sensor_source.hpp"
#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// The samples of a recording in memory, with tags detected once for many replays.
struct LoadedSamples {
  std::vector<ImuSample> imu;
  std::vector<CornerFrame> frames;  ///< By time; images were detected.
  long tags{};                      ///< Sightings in all frames together.
  FewImages few;                    ///< Of the source, for why_no_tag.
  bool begins_still{};              ///< The begin was checked with StillnessDetector.
};

/// Called with the number of images loaded so far.
using LoadProgress = std::function<void(std::size_t images)>;

/// @return Error when the source is lost
[[nodiscard]] Expected<LoadedSamples> load_samples(const OfflineSetup& setup, SensorSource& source,
                                                   const LoadProgress& progress = {});

/// Returns the samples by time, from `begin` on, with `shift` added to the stamps of all images.
/// Refers to the samples.
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

/// Detects a body that hardly rotates or accelerates, such as one held still by hand: low-pass
/// filtered rates (50 ms), and specific force compared with its mean of 500 ms. Ignores readings
/// that are not finite; restarts after a gap.
///
/// A filter with an uncertain camera pose must start at rest, where the force shows the vertical.
/// Started during motion, one run in eight converges to a wrong solution, off by centimetres with a
/// sigma of millimetres.
class StillnessDetector final {
 public:
  void add(const ImuSample& sample);
  /// Still for long enough to start a filter at the begin of that time.
  [[nodiscard]] bool is_still() const { return still_s_ >= kMinStill_s; }
  /// At most one reading since the (re)start.
  [[nodiscard]] bool is_new() const { return samples_ <= 1; }
  /// Time since the last motion, s.
  [[nodiscard]] double still_s() const { return still_s_; }

 private:
  static constexpr double kMinStill_s = 0.7;

  std::optional<Instant> last_at_;
  Eigen::Vector3d w_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d f_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d slow_f_{Eigen::Vector3d::Zero()};
  int samples_{0};
  double still_s_{0};
};

/// @return the begin of the first rest during which tags are in view
[[nodiscard]] std::optional<Instant> first_rest(const LoadedSamples& samples);

}  // namespace fiducap
