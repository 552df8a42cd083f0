#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// Faults of an IMU's units, then of the flow of its readings.
enum class ImuFault {
  kForceInG,                ///< Specific force around 1: in g.
  kForceInMilliG,           ///< … around 1000: in thousandths of g.
  kForceWithoutGravity,     ///< … around 0: gravity was removed, or the sensor is dead.
  kRateInDegreesPerSecond,  ///< Rotations are 57 times those of the tags.
  kForceUnlikely,           ///< Specific force far from gravity in another way.
  kFrozen,                  ///< All six numbers stay exactly the same.
  kSlow,                    ///< Far fewer readings than configured.
  kHoles,                   ///< Readings are missing again and again.
  kRepeated,                ///< Many are exactly the one before.
};

/// The fault, its likely cause and a remedy, as one sentence.
[[nodiscard]] std::string_view text_of(ImuFault fault);
/// The readings are unusable.
[[nodiscard]] inline bool is_fatal(ImuFault fault) {
  return fault <= ImuFault::kRateInDegreesPerSecond;
}

/// Checks rate, gaps and changes of the readings in windows of five seconds. Two windows in a row
/// with the same fault begin it, three sound ones end it. Allocates nothing but the texts.
class ImuFlow final {
 public:
  /// @param configured_hz  0: not known, nothing is checked
  explicit ImuFlow(double configured_hz) : configured_hz_(configured_hz) {}

  void add(const ImuSample& imu);
  [[nodiscard]] const std::optional<ImuFault>& fault() const { return fault_; }
  /// The fault with figures, its likely cause and a remedy, as one sentence.
  [[nodiscard]] std::string text() const;

 private:
  struct Window {
    std::optional<Instant> began;
    int readings{0};
    int repeated{0};
    int holes{0};
    Duration longest{0};
  };
  [[nodiscard]] std::optional<ImuFault> judge(double seconds) const;

  double configured_hz_;
  std::optional<ImuSample> last_;
  Window window_;
  Window faulty_;  ///< That showed the present fault.
  double faulty_s_{1};
  std::optional<ImuFault> seen_;  ///< In the window before.
  std::optional<ImuFault> fault_;
  int sound_windows_{0};
};

/// Present faults of the forces, of the rates, and of the flow.
using ImuFaults = std::array<std::optional<ImuFault>, 3>;

/// The faults to report after a change: those that are new, and all when another one has ended.
[[nodiscard]] std::vector<ImuFault> faults_to_report(const ImuFaults& before, const ImuFaults& now);

/// Checks an IMU's units in its first seconds, after each pause, and while a fault holds.
///
/// The median specific force of anything carried, driving or flying is near gravity. The rotation
/// between two images is known from a tag that both show, of any size and pose; the gyro's is
/// compared as it is and as if it were in degrees, beyond three degrees and at most four times a
/// second, until decided. The flow is checked all the time. No allocation once decided.
class ImuPlausibility final {
 public:
  /// Without checking the flow.
  ImuPlausibility() = default;
  explicit ImuPlausibility(double configured_hz) : flow_(configured_hz) {}

  void add(const ImuSample& imu);
  /// An image, in the order of SampleMerger: after the IMU samples before it.
  void add(const TagObservations& seen, const CameraModel& camera);

  [[nodiscard]] ImuFaults faults() const { return {force_fault_, rate_fault_, flow_.fault()}; }
  /// As `text_of`, with figures where there are some.
  [[nodiscard]] std::string text(ImuFault fault) const;

 private:
  static constexpr std::size_t kForces = 400;

  /// One tag in one image of one camera.
  struct TagView {
    int camera{};
    Instant at{};
    TagObservation tag{};
    /// The gyro's rotation since the first sample, as it is and read as degrees.
    Eigen::Quaterniond turned{};
    Eigen::Quaterniond turned_by_degrees{};
  };
  void judge_forces();
  void compare(const TagView& before, const TagView& now, const CameraModel& camera);
  [[nodiscard]] bool rates_are_judged() const;

  std::array<double, kForces> forces_m_s2_{};
  std::size_t forces_{0};
  int sound_forces_{0};  ///< Judgements in a row.
  std::optional<ImuFault> force_fault_;

  std::optional<Instant> last_at_;
  std::optional<ImuSample> last_;
  std::optional<Instant> last_force_at_;
  Eigen::Quaterniond turned_{Eigen::Quaterniond::Identity()};
  Eigen::Quaterniond turned_by_degrees_{Eigen::Quaterniond::Identity()};
  std::optional<TagView> view_;
  int comparisons_{0};
  int for_radians_{0};
  int for_degrees_{0};
  std::optional<ImuFault> rate_fault_;
  ImuFlow flow_{0};
};

}  // namespace fiducap
