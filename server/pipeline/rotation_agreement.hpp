#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/start/time_offset.hpp"

namespace fiducap {

/// Result of comparing one camera with the gyroscope.
struct AgreementFinding {
  enum class Kind {
    kAgree,          ///< Axes and clock are as expected.
    kAxesTurned,     ///< The camera (or the gyro) is turned against its configured axes.
    kAxesReflected,  ///< Two axes of the gyro are swapped, or a sign is wrong.
    kAxesApart,      ///< One of both: the body turns about too few axes to decide.
    kShifted,        ///< The clock offset is outside of the configured tolerance.
    kJumped,         ///< The clock offset was right and has changed.
    kDegrees,        ///< The gyro's samples are in degrees per second.
  } kind{Kind::kAgree};
  OffsetFit fit;
  double jump_s{};  ///< Of kJumped: change of `fit.shift_s`.
};

/// Compares the rotations of one camera with those of the gyroscope (TimeOffset), and decides.
///
/// No result while the body hardly turns, nor when no single cause explains the turns. Allocates
/// nothing after construction.
class CameraAgreement final {
 public:
  /// @param start_shift_s  known clock offset beyond the configuration
  CameraAgreement(const CameraMount& mount, double start_shift_s, double corner_noise_px);

  /// @param fits  the filter explains the images: once axes and clock were found to agree, they are
  ///              then only kept
  void add(const TagObservations& seen, const GyroIntegral& gyro, bool fits);
  /// The clock offset that the filter uses.
  void set_used_shift(double shift_s) { used_shift_s_ = shift_s; }
  /// The filter has found a jump of the clock: earlier turns are of another one.
  void note_jump(double shift_s);

  /// A new finding, once.
  [[nodiscard]] std::optional<AgreementFinding> take_finding();
  /// Axes and clock were found to agree at least once.
  [[nodiscard]] bool is_established() const { return is_clock_known_ && !axes_are_wrong_; }
  /// This camera's images cannot be used together with the gyroscope.
  [[nodiscard]] bool contradicts() const { return axes_are_wrong_ || shift_is_wrong(); }
  [[nodiscard]] bool has_degrees() const { return has_degrees_; }

 private:
  [[nodiscard]] bool shift_is_wrong() const;
  [[nodiscard]] double tolerance_s() const;
  void judge();
  [[nodiscard]] std::optional<AgreementFinding> find_cause() const;
  [[nodiscard]] bool is_as_expected(const OffsetFit& fit) const;
  [[nodiscard]] std::optional<AgreementFinding> find_shift(const OffsetFit& expected,
                                                           std::size_t newest) const;
  [[nodiscard]] std::optional<AgreementFinding> find_axes(const OffsetFit& configured) const;
  void note_agreement(const AgreementFinding& found);
  void note_wrong_axes(const AgreementFinding& found);
  void forget_turns();

  CameraMount mount_;
  TimeOffset offset_;
  double start_shift_s_;
  double used_shift_s_;
  std::size_t new_turns_{0};
  std::optional<AgreementFinding> candidate_;
  int found_again_{0};  ///< Judgements in a row with the same outcome.
  bool is_clock_known_{false};
  bool has_degrees_{false};
  bool axes_are_wrong_{false};
  std::optional<AgreementFinding::Kind> axes_reported_;
  std::optional<double> reported_shift_s_;  ///< Last one that contradicted the filter's.
  std::optional<AgreementFinding> new_finding_;
};

/// A clock that was right and has jumped.
struct ClockJump {
  int camera{};
  Instant at{};        ///< When it was found, on the corrected clock.
  Duration shift{0};   ///< Offset from now on, beyond the configuration.
  Duration change{0};  ///< Difference to the offset before.
};

/// A finding about one camera of a body, with its message.
struct AgreementReport {
  int camera{};
  AgreementFinding finding;
  std::string text;
};

/// Message for the user, e.g. `camera 0 looks along other axes than configured: …`.
[[nodiscard]] std::string agreement_text(int camera, const CameraMount& mount,
                                         const AgreementFinding& finding);

/// Whether the cameras of a body and its gyro measure the same rotations.
///
/// Gets IMU samples on arrival and images in the order of SampleMerger. Does nothing without an
/// IMU.
class RotationAgreement final {
 public:
  RotationAgreement(const BodySensors& sensors, double corner_noise_px);

  void add(const ImuSample& imu);
  /// @param fits  see CameraAgreement::add()
  void add(const TagObservations& seen, bool fits = false);
  /// The clock offset that the filter uses for a camera.
  void set_used_shift(int camera, double shift_s);
  /// The filter has found a jump of a camera's clock. @return message
  std::string note_jump(const UpdateReport::ClockJump& jump);

  /// Each finding once.
  [[nodiscard]] std::optional<AgreementReport> take_report();
  /// A camera contradicts the gyro: the body's poses must not be used.
  [[nodiscard]] bool withholds() const;
  /// All cameras were found to agree with the gyro.
  [[nodiscard]] bool is_established() const;
  /// The gyroscope's samples seem to be in degrees per second.
  [[nodiscard]] bool has_degrees() const {
    return std::ranges::any_of(cameras_, &CameraAgreement::has_degrees);
  }
  /// The last one.
  [[nodiscard]] const std::optional<ClockJump>& clock_jump() const { return clock_jump_; }

 private:
  [[nodiscard]] bool has(int camera) const {
    return camera >= 0 && static_cast<std::size_t>(camera) < cameras_.size();
  }

  std::vector<CameraMount> mounts_;
  GyroIntegral gyro_;
  std::vector<CameraAgreement> cameras_;
  std::optional<ClockJump> clock_jump_;
};

}  // namespace fiducap
