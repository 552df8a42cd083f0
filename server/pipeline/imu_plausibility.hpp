#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/imu_sample.hpp"

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

/// Checks the unit of an IMU's forces in its first seconds, after each pause, and while a fault
/// holds: the median specific force of anything carried, driving or flying is near gravity. The
/// flow is checked all the time. Allocates nothing but the texts.
class ImuPlausibility final {
 public:
  /// Without checking the flow.
  ImuPlausibility() = default;
  explicit ImuPlausibility(double configured_hz) : flow_(configured_hz) {}

  void add(const ImuSample& imu);

  /// @param has_degrees  see RotationAgreement
  [[nodiscard]] ImuFaults faults(bool has_degrees) const {
    using enum ImuFault;
    return {force_fault_, has_degrees ? std::optional(kRateInDegreesPerSecond) : std::nullopt,
            flow_.fault()};
  }
  /// As `text_of`, with figures where there are some.
  [[nodiscard]] std::string text(ImuFault fault) const;

 private:
  static constexpr std::size_t kForces = 400;

  void judge_forces();

  std::array<double, kForces> forces_m_s2_{};
  std::size_t forces_{0};
  int sound_forces_{0};  ///< Judgements in a row.
  std::optional<ImuFault> force_fault_;
  std::optional<Instant> last_at_;
  std::optional<Instant> last_force_at_;
  ImuFlow flow_{0};
};

}  // namespace fiducap
