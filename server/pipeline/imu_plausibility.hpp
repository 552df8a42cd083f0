#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <Eigen/Geometry>

#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "pipeline/imu_flow.hpp"

namespace fiducap {

/// What an IMU's readings say about their units.
enum class ImuFault {
  kForceInG,                ///< Specific force around 1: in g.
  kForceInMilliG,           ///< … around 1000: in thousandths of g.
  kForceWithoutGravity,     ///< … around 0: gravity was taken out, or the sensor is dead.
  kForceUnlikely,           ///< … far from gravity in another way.
  kRateInDegreesPerSecond,  ///< Turns are 57 times those that the tags show.
  kFlow,                    ///< Nothing is wrong with the unit but with how readings come: ImuFlow.
};

/// With the fault what is probably wrong and what to do, as one sentence.
[[nodiscard]] std::string_view text_of(ImuFault fault);
/// Nothing sensible comes of such readings.
[[nodiscard]] bool is_fatal(ImuFault fault);

/// Physics against units: looks at an IMU's first seconds, again after each pause, and while
/// something is wrong with it.
///
/// The specific force of what moves by hand, on wheels or in the air has its median near gravity.
/// The turn between two images is known from a tag that both show, whatever its size and place; the
/// gyro is compared with it as it is and as if it gave degrees. Turns below three degrees say
/// nothing, and cost nothing. How readings come is judged all the time, see ImuFlow. Compares four
/// times a second at most, and no more once it knows: no allocation from then on.
class ImuPlausibility final {
 public:
  /// How readings come is not judged.
  ImuPlausibility() = default;
  /// @param promised_hz  the configured rate
  explicit ImuPlausibility(double promised_hz) : flow_(promised_hz) {}

  void add(const ImuSample& imu);
  /// An image, in the order of SampleMerger: after the IMU samples before it.
  void add(const TagObservations& seen, const CameraModel& camera);

  /// What was found since the last call; each fault once, and again when it is what is left of two.
  [[nodiscard]] std::optional<ImuFault> take_news();
  /// As `text_of`, with figures where there are some.
  [[nodiscard]] std::string text(ImuFault fault) const;
  /// Since the last call the last fault was found to be mended.
  [[nodiscard]] bool take_all_clear() { return std::exchange(all_clear_, false); }

 private:
  static constexpr std::size_t kForces = 400;

  /// One tag in one image of one camera.
  struct Look {
    int camera{};
    Instant at{};
    TagObservation tag{};
    /// The gyro's turn since the first sample, as it is and read as degrees.
    Eigen::Quaterniond turned{};
    Eigen::Quaterniond turned_by_degrees{};
  };
  void judge_anew();
  void judge_forces();
  void judge_rates();
  void judge_flow();
  void say_what_is_left();
  void compare(const Look& before, const Look& now, const CameraModel& camera);
  [[nodiscard]] bool rates_are_judged() const;

  std::array<double, kForces> forces_m_s2_{};
  std::size_t forces_{0};
  int sound_forces_{0};  ///< Judgements in a row.
  std::optional<ImuFault> force_fault_;
  std::optional<ImuFault> force_news_;

  std::optional<Instant> last_at_;
  std::optional<ImuSample> last_;
  std::optional<Instant> last_force_at_;
  Eigen::Quaterniond turned_{Eigen::Quaterniond::Identity()};
  Eigen::Quaterniond turned_by_degrees_{Eigen::Quaterniond::Identity()};
  std::optional<Look> look_;
  int comparisons_{0};
  int for_radians_{0};
  int for_degrees_{0};
  std::optional<ImuFault> rate_fault_;
  std::optional<ImuFault> rate_news_;
  ImuFlow flow_{0};
  std::optional<FlowFault> flow_fault_;
  bool flow_news_{false};
  bool all_clear_{false};
};

}  // namespace fiducap
