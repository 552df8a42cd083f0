#pragma once

#include <Eigen/Core>

#include "base/pose.hpp"
#include "estimation/known_tag.hpp"

/// Errors of poses on the world's side: X = Exp(ξ) X̂, ξ = (ρ, φ), see state_layout.hpp.
namespace fiducap::world {

/// Exp(ξ) X. The group's own exponential: a turning about a tag's centre leaves the centre where it
/// is, however far away the origin of W is and however large the turning.
[[nodiscard]] Pose moved(const Pose& X, const Eigen::Ref<const Eigen::VectorXd>& error);
/// The world-side error ξ that leads from one pose to another: to = Exp(ξ) from.
[[nodiscard]] Vector6d world_error_between(const Pose& from, const Pose& to);
/// Ad(X): the world-side error that an error on the other side of X is.
[[nodiscard]] Matrix6d adjoint(const Pose& X);
/// ∂ (position, rotation vector, both W axes) / ∂ ξ of a pose at p: position moves by ρ + φ × p.
[[nodiscard]] Matrix6d plain_from_world_error(const Eigen::Vector3d& p);
/// Its inverse.
[[nodiscard]] Matrix6d world_from_plain_error(const Eigen::Vector3d& p);

}  // namespace fiducap::world
