#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

namespace fiducap {

// Dense algebra of tests, compiled once: Eigen's products and decompositions are most of what a
// test of a filter costs to compile.

/// Maps n error coordinates to m numbers.
using VectorFunction = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;

/// Central differences of f at zero perturbation.
[[nodiscard]] Eigen::MatrixXd central_differences(const VectorFunction& f, Eigen::Index n,
                                                  double step = 1e-5);

/// Compares an analytic Jacobian with central differences and prints both when they disagree.
void expect_jacobian(const Eigen::MatrixXd& analytic, const VectorFunction& f,
                     double tolerance = 1e-6, double step = 1e-5);

/// The largest difference of two matrices is below `tolerance` times the largest number expected.
void expect_matrices_near(const Eigen::MatrixXd& got, const Eigen::MatrixXd& expected,
                          double tolerance);

/// S with S x = (x of these indices), for x of `size` numbers (k × size).
[[nodiscard]] Eigen::MatrixXd selection(std::span<const int> indices, Eigen::Index size);

/// Covariance of these numbers alone.
[[nodiscard]] Eigen::MatrixXd marginal(const Eigen::MatrixXd& P, std::span<const int> indices);

/// J P Jᵀ
[[nodiscard]] Eigen::MatrixXd propagated(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P);

/// eᵀ P⁻¹ e
[[nodiscard]] double squared_distance(const Eigen::VectorXd& e, const Eigen::MatrixXd& P);

[[nodiscard]] Eigen::MatrixXd inverse(const Eigen::MatrixXd& A);

/// Of a symmetric matrix.
[[nodiscard]] double least_eigenvalue(const Eigen::MatrixXd& P);

}  // namespace fiducap
