#pragma once

#include <vector>

#include "base/pose.hpp"
#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// How a target may differ from what was said of it, in halves of its longer side L; the axes ξ, η
/// go from its middle, ±1 at the ends of the longer side: out of the plane by L (a ξ² + b ξη + c
/// η²); x longer and y shorter by half of d each; sides not square to each other by e.
inline constexpr Eigen::Index kShapeNumbers = 5;

/// Normal equations of an adjusted state with the poses of views taken out (Schur complement): the
/// free lens numbers first, then targets that do not define their group, then the shape of one.
class ReducedSystem final {
 public:
  /// @param shaped  the target whose shape is open; -1: none
  ReducedSystem(const CalibrationData& data, const CalibrationState& state,
                const std::vector<int>& free, int shaped = -1);

  [[nodiscard]] const Eigen::MatrixXd& information() const { return S_; }
  /// Per view: the gradient of its own squared residuals / 2, poses taken out.
  [[nodiscard]] const std::vector<Eigen::VectorXd>& pulls() const { return pulls_; }
  /// Squared residuals, summed, and what is left of their number when all unknowns are taken off.
  [[nodiscard]] double squares() const { return squares_; }
  [[nodiscard]] double freedom() const { return freedom_ - static_cast<double>(size_); }
  /// information()⁻¹. @return false when it is singular
  [[nodiscard]] bool invert(Eigen::MatrixXd& inverse) const;
  /// Condition of the information, its diagonal scaled to 1; infinite when singular.
  [[nodiscard]] double condition() const;

 private:
  /// What one group in one view adds.
  struct Share;

  [[nodiscard]] bool is_seen(std::size_t target) const;
  void add_view(std::size_t v);
  void add_point(const SeenPoint& seen, std::size_t target, const Pose& X_VG, Share& share,
                 Eigen::VectorXd& pull);
  /// One more block of unknowns that moves a point's pixel by `J`.
  void add_block(Eigen::Index column, const Eigen::Matrix<double, 2, Eigen::Dynamic>& J,
                 const Eigen::Matrix<double, 2, Eigen::Dynamic>& J_lens,
                 const Eigen::Matrix<double, 2, 6>& J_pose, const Eigen::Vector2d& y, Share& share,
                 Eigen::VectorXd& pull);
  [[nodiscard]] Eigen::Matrix<double, 3, kShapeNumbers> shape_at(const Eigen::Vector3d& p_T) const;

  const CalibrationData& data_;
  const CalibrationState& state_;
  const std::vector<int>& free_;
  int shaped_;
  Eigen::Vector3d middle_{Eigen::Vector3d::Zero()};
  double half_side_{1};
  std::vector<Eigen::Index> column_;
  Eigen::Index size_{0};
  Eigen::MatrixXd S_;
  std::vector<Eigen::VectorXd> pulls_;
  double squares_{0};
  double freedom_{0};  ///< Without lens, targets and shape.
};

/// Half of the longer side of a target, and its middle.
[[nodiscard]] double half_side(const CalibrationTarget& target, Eigen::Vector3d& middle);

}  // namespace fiducap
