#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "pipeline/agreement/agreement_finding.hpp"
#include "pipeline/agreement/gyro_integral.hpp"
#include "pipeline/agreement/tag_turns.hpp"

namespace fiducap {

/// Whether one camera and the gyro see the same turns at the same time, by tags wherever they hang.
///
/// Compares turns over a third of a second, ten times a second, by two tags each: a thousandth of a
/// processor core. Nothing is computed while the gyro hardly turns. Says nothing while the body
/// hardly turns, and nothing when no single cause explains what is seen. Allocates nothing after
/// construction.
class CameraAgreement final {
 public:
  /// @param told_shift_s  what is known of the clock beyond the configuration
  CameraAgreement(const CameraMount& mount, double told_shift_s, double corner_noise_px);

  /// An image now would be of use. @param stamp  without what a filter has learned
  [[nodiscard]] bool wants(Instant stamp) const;
  void add(const TagObservations& seen, const GyroIntegral& gyro);
  /// What the filter adds to the stamps, when it is sure of it.
  void set_used_shift(double shift_s) { used_shift_s_ = shift_s; }

  /// The filter has found out by itself: stamps are off by so much from now on.
  void note_jump(double shift_s);

  [[nodiscard]] std::optional<AgreementFinding> take_news();
  /// Axes and clock were once found to agree.
  [[nodiscard]] bool is_established() const {
    return known_shift_s_.has_value() && !axes_are_wrong_;
  }
  /// What comes of this camera's images with this gyro cannot be right.
  [[nodiscard]] bool contradicts() const { return axes_are_wrong_ || shift_is_wrong(); }

 private:
  static constexpr std::size_t kLooks = 24;

  [[nodiscard]] Look& look(std::size_t number) { return looks_[number % kLooks]; }
  [[nodiscard]] bool shift_is_wrong() const;
  void pair_up(const GyroIntegral& gyro);
  void pair(const Look& now, std::size_t number, const GyroIntegral& gyro);
  void judge();
  void conclude(const AgreementFinding& found);
  void note_agreement(const AgreementFinding& found);
  void note_wrong_axes(const AgreementFinding& found);
  void say(const AgreementFinding& found) { news_ = found; }

  CameraMount mount_;
  double corner_noise_px_;
  double told_shift_s_;
  double tolerance_s_;
  double used_shift_s_;

  std::array<Look, kLooks> looks_;
  std::size_t looks_taken_{0};
  std::size_t looks_paired_{0};

  std::vector<TurnPair> pairs_;  ///< Oldest first.
  std::size_t new_pairs_{0};

  std::optional<AgreementFinding> candidate_;
  int found_again_{0};  ///< Judgements in a row with the same outcome.
  std::optional<double> known_shift_s_;
  bool axes_are_wrong_{false};
  std::optional<AgreementFinding::Kind> axes_said_;
  bool shift_was_named_{false};
  std::optional<AgreementFinding> news_;
};

}  // namespace fiducap
