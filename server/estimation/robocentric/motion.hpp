#pragma once

#include <Eigen/Core>
#include <vector>

#include "base/pose.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// Motion between two images, accumulated over the integration steps: a step costs the same for any
/// number of tags, which are moved once per image (FrameTransition).
struct MotionSinceImage {
  Pose X_B0B;  ///< Body now, in the body axes of the last image.
  /// ∂ (body, step) now / ∂ body at the last image.
  MotionFromBody Phi{MotionFromBody::Identity()};
  MotionMatrix Q{MotionMatrix::Zero()};  ///< Covariance of the added noise.

  void restart() { *this = MotionSinceImage{}; }
};

/// Jacobian and noise of one integration step; (body, step since image) as in `layout`.
struct StepJacobians {
  MotionMatrix F{MotionMatrix::Identity()};
  /// Of white noise of gyroscope and accelerometer, held over the step.
  Eigen::Matrix<double, layout::kMotionSize, 3> G_w{};
  Eigen::Matrix<double, layout::kMotionSize, 3> G_f{};
};

/// Moves the body's mean over dt. RCARS II-D3, eq. for r, v, q and, through X_B0B, for r_T and q_T.
/// The paper uses Euler steps; here the rotation is exact and the force is rotated by half of it
/// (mid-point rule), so that the IMU noise needs no inflation.
/// @param gravity_W  e.g. (0, 0, -9.81)
StepJacobians step_mean(FilterState& state, MotionSinceImage& motion, const InertialInput& input,
                        const Eigen::Vector3d& gravity_W, double dt);

/// One integration step: mean, Φ and Q. The covariance of `state` itself is not changed.
void propagate(FilterState& state, MotionSinceImage& motion, const InertialInput& input,
               const Eigen::Vector3d& gravity_W, double dt);

/// Moves the body's mean by X_B0B, velocity to zero, linearised at X_B0B: the step may be
/// arbitrarily uncertain.
/// @return the motion for FrameTransition
[[nodiscard]] MotionSinceImage step_by_unknown_motion(FilterState& state, const Pose& X_B0B,
                                                      bool has_imu);

/// Moves tags and covariance by the motion of the body (RCARS II-D3, eq. for r_T and q_T, in exact
/// form), once per image.
///
/// Body and step blocks by Φ, tag blocks P_ij ← A_i P_ij A_jᵀ plus the contributions of motion and
/// extrinsics; never a dense F P Fᵀ. Keeps its memory.
class FrameTransition final {
 public:
  /// @pre the mean of the body is at the end of `motion`
  /// @post motion is restarted
  void apply(FilterState& state, MotionSinceImage& motion);
  /// Error of the whole state from an error of (body, step). @pre apply() was called on this state
  [[nodiscard]] Eigen::VectorXd spread(
      const FilterState& state, const Eigen::Matrix<double, layout::kMotionSize, 1>& error) const;

 private:
  using Matrix12d = Eigen::Matrix<double, 12, 12>;
  /// Motion of one tag: δ' = A δ + M (step, extrinsics of camera 0).
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
  Eigen::MatrixXd body_tags_;  ///< scratch: (body, step) × (cameras, tags)
};

}  // namespace fiducap::robocentric
