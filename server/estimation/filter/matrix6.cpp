#include "estimation/filter/matrix6.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace fiducap {

SymmetricEigen6 symmetric_eigen(const Matrix6d& S) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(S);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

double squared_distance(const Vector6d& e, const Matrix6d& S) { return e.dot(S.ldlt().solve(e)); }

Matrix6d inverse6(const Matrix6d& A) { return A.inverse(); }

}  // namespace fiducap
