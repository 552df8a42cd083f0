#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>

namespace fiducap {

/// Central differences of f at zero perturbation. @param f  maps an n-vector of error coordinates
/// to an m-vector.
inline Eigen::MatrixXd central_differences(
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& f, Eigen::Index n,
    double step = 1e-5) {
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

/// Compares an analytic Jacobian with central differences and prints both when they disagree.
inline void expect_jacobian(const Eigen::MatrixXd& analytic,
                            const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& f,
                            double tolerance = 1e-6, double step = 1e-5) {
  const Eigen::MatrixXd numeric = central_differences(f, analytic.cols(), step);
  ASSERT_EQ(analytic.rows(), numeric.rows());
  const double scale = std::max(1.0, numeric.cwiseAbs().maxCoeff());
  EXPECT_LE((analytic - numeric).cwiseAbs().maxCoeff(), tolerance * scale)
      << "analytic:\n"
      << analytic << "\nnumeric:\n"
      << numeric;
}

}  // namespace fiducap
