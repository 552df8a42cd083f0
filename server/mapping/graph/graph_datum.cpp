#include "mapping/graph/graph_datum.hpp"

#include <cmath>

#include <Eigen/LU>

#include "base/so3.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap {

namespace {

Eigen::Matrix<double, 6, 4> common_error() {
  Eigen::Matrix<double, 6, 4> N = Eigen::Matrix<double, 6, 4>::Zero();
  N.topLeftCorner<3, 3>().setIdentity();
  N(5, 3) = 1;
  return N;
}

}  // namespace

Pose lay_over(std::span<const std::pair<Eigen::Vector3d, Eigen::Vector3d>> points) {
  if (points.empty()) return {};
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  for (const auto& [a, b] : points) {
    from += a / static_cast<double>(points.size());
    to += b / static_cast<double>(points.size());
  }
  double sine = 0;
  double cosine = 0;
  for (const auto& [a, b] : points) {
    const Eigen::Vector2d x = (a - from).head<2>();
    const Eigen::Vector2d y = (b - to).head<2>();
    cosine += x.dot(y);
    sine += x.x() * y.y() - x.y() * y.x();
  }
  const bool has_heading = std::hypot(sine, cosine) > 0;
  const Eigen::Quaterniond turn = exp_so3({0, 0, has_heading ? std::atan2(sine, cosine) : 0.0});
  return {turn, to - turn * from};
}

Datum::Datum(const std::vector<Tag>& defining, const std::vector<Pose>& poses,
             const BlockCholesky& factor, const BlockMatrix& matrix) {
  for (int i = 0; i < matrix.variables(); ++i) first_.push_back(matrix.first(i));
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Tag& tag : defining) middle += tag.p_WT / static_cast<double>(defining.size());
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(matrix.rows(), 4);
  Eigen::Matrix4d BtN = Eigen::Matrix4d::Zero();
  for (std::size_t k = 0; k < defining.size(); ++k) {
    Eigen::Matrix<double, 6, 4> own = Eigen::Matrix<double, 6, 4>::Zero();
    if (defining.size() == 1) {
      own.topLeftCorner<3, 3>().setIdentity();
      own.block<3, 3>(3, 0) = skew(poses[k].p);
      own(5, 3) = 1;
    } else {
      const Eigen::Vector3d arm = Eigen::Vector3d::UnitZ().cross(defining[k].p_WT - middle);
      Eigen::Matrix<double, 4, 3> on_place;
      on_place << Eigen::Matrix3d::Identity(), arm.transpose();
      own = (on_place * world::plain_from_world_error(poses[k].p).topRows<3>()).transpose();
    }
    B.middleRows<6>(matrix.first(defining[k].variable)) += own;
    BtN += own.transpose() * common_error();
  }
  M_ = BtN.inverse();
  C_ = factor.solve(B);
  T_ = B.transpose() * C_;
}

Matrix6d Datum::between(int first, int second, const Matrix6d& raw) const {
  const Common NM = common_error() * M_;
  const auto Ci = C_.middleRows<6>(first_[static_cast<std::size_t>(first)]);
  const auto Cj = C_.middleRows<6>(first_[static_cast<std::size_t>(second)]);
  return raw - NM * Cj.transpose() - Ci * NM.transpose() + NM * T_ * NM.transpose();
}

Eigen::MatrixXd Datum::of(std::span<const Rows> rows, const Eigen::MatrixXd& raw) const {
  Eigen::MatrixXd NM = Eigen::MatrixXd::Zero(raw.rows(), 4);
  Eigen::MatrixXd C(raw.rows(), 4);
  Eigen::Index at = 0;
  for (const Rows& one : rows) {
    if (one.is_in_room) NM.middleRows<6>(at) = common_error() * M_;
    C.middleRows(at, one.size) =
        C_.middleRows(first_[static_cast<std::size_t>(one.variable)], one.size);
    at += one.size;
  }
  return raw - NM * C.transpose() - C * NM.transpose() + NM * T_ * NM.transpose();
}

}  // namespace fiducap
