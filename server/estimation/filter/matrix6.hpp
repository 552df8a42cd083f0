#pragma once

#include "estimation/known_tag.hpp"

/// Decompositions of 6 × 6 matrices, compiled once: each of them takes the compiler seconds.
namespace fiducap {

/// S = V diag(values) Vᵀ
struct SymmetricEigen6 {
  Vector6d values;  ///< Ascending.
  Matrix6d V;
};

/// @param S  symmetric; its lower triangle is read
[[nodiscard]] SymmetricEigen6 symmetric_eigen(const Matrix6d& S);

/// Squared Mahalanobis distance eᵀ S⁻¹ e.
[[nodiscard]] double squared_distance(const Vector6d& e, const Matrix6d& S);

/// By LU with partial pivoting.
[[nodiscard]] Matrix6d inverse6(const Matrix6d& A);

}  // namespace fiducap
