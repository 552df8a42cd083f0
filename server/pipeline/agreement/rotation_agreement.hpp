#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "estimation/body_filter.hpp"
#include "pipeline/agreement/turns.hpp"

namespace fiducap {

/// Compares the rotations of one camera with those of the gyro, by tags that need not be mapped.
///
/// Ten times a second a turn over a third of a second, from two tags: 0.1 % of a processor core.
/// No result while the body hardly turns, nor when no single cause explains the turns. Allocates
/// nothing after construction.
class CameraAgreement final {
 public:
  /// @param start_shift_s  known clock offset beyond the configuration
  CameraAgreement(const CameraMount& mount, double start_shift_s, double corner_noise_px);

  /// Whether an image is due. @param stamp  without the estimated clock offset
  [[nodiscard]] bool wants(Instant stamp) const;
  void add(const TagObservations& seen, const GyroIntegral& gyro);
  /// The clock offset that the filter uses.
  void set_used_shift(double shift_s) { used_shift_s_ = shift_s; }
  /// The filter has found a jump of the clock. @param shift_s  offset from now on
  void note_jump(double shift_s);

  /// A new finding, once.
  [[nodiscard]] std::optional<AgreementFinding> take_finding();
  /// Axes and clock were found to agree at least once.
  [[nodiscard]] bool is_established() const {
    return known_shift_s_.has_value() && !axes_are_wrong_;
  }
  /// This camera's images cannot be used together with the gyro.
  [[nodiscard]] bool contradicts() const { return axes_are_wrong_ || shift_is_wrong(); }

 private:
  static constexpr std::size_t kImages = 24;

  [[nodiscard]] LargestTags& image(std::size_t number) { return images_[number % kImages]; }
  [[nodiscard]] bool shift_is_wrong() const;
  void pair_up(const GyroIntegral& gyro);
  void pair(const LargestTags& now, std::size_t number, const GyroIntegral& gyro);
  void judge();
  void note_agreement(const AgreementFinding& found);
  void note_wrong_axes(const AgreementFinding& found);

  CameraMount mount_;
  double corner_noise_px_;
  double start_shift_s_;
  double tolerance_s_;
  double used_shift_s_;

  std::array<LargestTags, kImages> images_;
  std::size_t images_taken_{0};
  std::size_t images_paired_{0};

  std::vector<TurnPair> pairs_;  ///< Oldest first.
  std::size_t new_pairs_{0};

  std::optional<AgreementFinding> candidate_;
  int found_again_{0};  ///< Judgements in a row with the same outcome.
  std::optional<double> known_shift_s_;
  bool axes_are_wrong_{false};
  std::optional<AgreementFinding::Kind> axes_reported_;
  bool shift_was_reported_{false};
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
/// Gets readings and images on arrival, with the device's stamps: with a clock far off, the merger
/// drops samples that are needed here. Does nothing without an IMU.
class RotationAgreement final {
 public:
  RotationAgreement(const BodySensors& sensors, double corner_noise_px);

  void add(const ImuSample& imu);
  /// Whether an image is due. @param stamp  without the estimated clock offset
  [[nodiscard]] bool wants(int camera, Instant stamp) const;
  void add(const TagObservations& seen);
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
