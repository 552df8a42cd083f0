#pragma once

#include <vector>

#include "estimation/robocentric/filter_state.hpp"
#include "estimation/robocentric/propagation.hpp"

namespace fiducap::robocentric {

/// Brings tags and covariance to the body's present place: the tags turn and move in the camera as
/// the body moved in the room (RCARS II-D3, eq. for r_T and q_T, in exact form), once per image
/// instead of once per inertial sample.
///
/// With N tags: body and step blocks by Φ, tag blocks P_ij ← A_i P_ij A_jᵀ + what the common motion
/// and the extrinsics add; never a dense F P Fᵀ. The scratch memory is kept, so nothing is
/// allocated after warm-up.
class FrameTransition final {
 public:
  /// @pre state's body mean already stands at the end of `motion`.
  /// @post motion is restarted
  void apply(FilterState& state, MotionSinceImage& motion);
  /// The error of the whole state that an error of (body, step) makes; @pre `apply` was just called
  /// on this state.
  [[nodiscard]] Eigen::VectorXd spread(
      const FilterState& state, const Eigen::Matrix<double, layout::kMotionSize, 1>& error) const;

 private:
  using Matrix12d = Eigen::Matrix<double, 12, 12>;
  /// How one tag moves: δ' = A δ + M (step, extrinsics of camera 0).
  struct TagMove {
    Matrix6d A;
    Eigen::Matrix<double, 6, 12> M;
    Eigen::Matrix<double, 12, 6> L;  ///< Cov(step+extrinsics, tag) before
    Eigen::Matrix<double, 6, 12> V;  ///< A Lᵀ
    Eigen::Matrix<double, 12, 6> U;  ///< L Aᵀ + S Mᵀ
  };
  [[nodiscard]] static TagMove move_tag(const Pose& X_BV, const Pose& X_B0B, Pose& X_VT);
  void move_tag_blocks(FilterState& state);

  std::vector<TagMove> moves_;
  Eigen::MatrixXd body_tags_;  ///< (body, step) × (cameras, tags) scratch
};

}  // namespace fiducap::robocentric
