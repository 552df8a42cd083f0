#pragma once

#include <optional>
#include <string>

#include "capture/imu_sample.hpp"

namespace fiducap {

/// How an IMU's readings come, whatever they say.
enum class FlowFault {
  kFrozen,    ///< All six numbers stay exactly the same.
  kSlow,      ///< Far fewer than configured.
  kHoles,     ///< Readings are missing again and again.
  kRepeated,  ///< Many are exactly the one before.
};

/// Judges readings in windows of five seconds: their rate against the promised one, holes, and
/// numbers that do not change. What two windows in a row show is a fault; three sound ones end it.
/// Allocates nothing but the texts.
class ImuFlow final {
 public:
  /// @param promised_hz  0: not known, nothing is judged
  explicit ImuFlow(double promised_hz) : promised_hz_(promised_hz) {}

  void add(const ImuSample& imu);

  /// What is wrong now.
  [[nodiscard]] const std::optional<FlowFault>& fault() const { return fault_; }
  /// It with its figures, what is probably the cause and what to do, as one sentence.
  [[nodiscard]] std::string text() const;

 private:
  struct Window {
    std::optional<Instant> began;
    int readings{0};
    int repeated{0};
    int holes{0};
    Duration longest{0};
  };
  [[nodiscard]] std::optional<FlowFault> judge(double seconds) const;
  void end_window(Instant at);

  double promised_hz_;
  std::optional<ImuSample> last_;
  Window window_;
  Window told_;  ///< What the present fault was seen in.
  double told_s_{1};
  std::optional<FlowFault> seen_;  ///< In the window before.
  std::optional<FlowFault> fault_;
  int sound_windows_{0};
};

}  // namespace fiducap
