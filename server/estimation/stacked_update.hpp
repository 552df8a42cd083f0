#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "estimation/tag_measurement.hpp"

namespace fiducap {

/// The Kalman update with all tags of one image at once, in whatever coordinates the filter has. Keeps its memory
/// between images.
///
/// `P` is the live covariance of the state, n × n and symmetric. Order of use: gate, then solve once per iteration, then
/// shrink.
class StackedUpdate final {
 public:
  using Covariance = Eigen::Ref<Eigen::MatrixXd>;
  using ConstCovariance = Eigen::Ref<const Eigen::MatrixXd>;

  /// Takes in the measurements whose Mahalanobis distance on the *joint* covariance is below `limit` (chi-square of 8),
  /// so that a tag seen again after drift counts as the loop closure it is.
  /// @param accepted  out: per measurement, whether it was taken in
  void gate(ConstCovariance P, std::span<const TagMeasurement> measurements, double limit, std::vector<bool>& accepted);

  /// What gate() saw of one measurement.
  struct Judged {
    double distance{};     ///< yᵀ S⁻¹ y; NaN when it lies behind the camera
    double noise_share{};  ///< trace R / trace S
  };
  [[nodiscard]] std::span<const Judged> judged() const { return judged_; }

  [[nodiscard]] bool empty() const { return used_.empty(); }
  [[nodiscard]] std::span<const std::size_t> used() const { return used_; }
  /// Length of the stacked innovation.
  [[nodiscard]] int rows() const { return 8 * static_cast<int>(used_.size()); }

  /// @param held  first columns of six-wide blocks that must not learn (Schmidt's consider states)
  /// @return normalised innovation squared yᵀ S⁻¹ y; the correction stands in correction()
  double solve(ConstCovariance P, std::span<const TagMeasurement> measurements, std::span<const int> held);
  [[nodiscard]] Eigen::Ref<const Eigen::VectorXd> correction() const { return dx_.head(n_); }

  /// P ← P − K S Kᵀ of the last solve(): symmetric by construction. What held blocks know of each other stays; their
  /// correlation with the rest follows, so that their uncertainty is neither forgotten nor counted twice.
  void shrink(Covariance P, std::span<const int> held) const;

  /// RMS over the corners of the used tags, raw pixels.
  [[nodiscard]] double rms_px(std::span<const TagMeasurement> measurements) const;

 private:
  void stack(ConstCovariance P, std::span<const TagMeasurement> measurements);

  Eigen::Index n_{0};
  std::vector<std::size_t> used_;
  std::vector<Judged> judged_;  ///< per measurement of the last gate()
  Eigen::MatrixXd PHt_;  ///< n × rows; after solve() the square-root gain K S^{1/2}
  Eigen::MatrixXd S_;
  Eigen::VectorXd y_;
  Eigen::VectorXd dx_;
};

}  // namespace fiducap
