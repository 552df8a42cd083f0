#include "support/jacobian_check.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>

namespace fiducap {

Eigen::MatrixXd central_differences(const VectorFunction& f, Eigen::Index n, double step) {
  Eigen::MatrixXd J;
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::VectorXd d = Eigen::VectorXd::Zero(n);
    d(i) = step;
    const Eigen::VectorXd column = (f(d) - f(-d)) / (2 * step);
    if (J.size() == 0) J.resize(column.size(), n);
    J.col(i) = column;
  }
  return J;
}

void expect_jacobian(const Eigen::MatrixXd& analytic, const VectorFunction& f, double tolerance,
                     double step) {
  const Eigen::MatrixXd numeric = central_differences(f, analytic.cols(), step);
  ASSERT_EQ(analytic.rows(), numeric.rows());
  const double scale = std::max(1.0, numeric.cwiseAbs().maxCoeff());
  EXPECT_LE((analytic - numeric).cwiseAbs().maxCoeff(), tolerance * scale)
      << "analytic:\n"
      << analytic << "\nnumeric:\n"
      << numeric;
}

void expect_matrices_near(const Eigen::MatrixXd& got, const Eigen::MatrixXd& expected,
                          double tolerance) {
  ASSERT_EQ(got.rows(), expected.rows());
  ASSERT_EQ(got.cols(), expected.cols());
  EXPECT_LT((got - expected).cwiseAbs().maxCoeff(), tolerance * expected.cwiseAbs().maxCoeff())
      << "got:\n"
      << got << "\nexpected:\n"
      << expected;
}

Eigen::MatrixXd selection(std::span<const int> indices, Eigen::Index size) {
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(indices.size()), size);
  for (Eigen::Index i = 0; i < S.rows(); ++i) S(i, indices[i]) = 1;
  return S;
}

Eigen::MatrixXd marginal(const Eigen::MatrixXd& P, std::span<const int> indices) {
  const auto size = static_cast<Eigen::Index>(indices.size());
  Eigen::MatrixXd out(size, size);
  for (Eigen::Index i = 0; i < size; ++i)
    for (Eigen::Index j = 0; j < size; ++j) out(i, j) = P(indices[i], indices[j]);
  return out;
}

Eigen::MatrixXd propagated(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P) {
  return J * P * J.transpose();
}

double squared_distance(const Eigen::VectorXd& e, const Eigen::MatrixXd& P) {
  return e.dot(P.ldlt().solve(e));
}

Eigen::MatrixXd inverse(const Eigen::MatrixXd& A) { return A.inverse(); }

double least_eigenvalue(const Eigen::MatrixXd& P) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(P, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .minCoeff();
}

}  // namespace fiducap
