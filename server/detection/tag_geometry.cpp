#include "detection/tag_geometry.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "capture/lens/lens.hpp"

namespace fiducap {
namespace {

constexpr double kMinDepth_m = 1e-3;  // closer, the pinhole projection diverges
constexpr double kMinSine = 0.02;     // of the angle between two sides: lower bound used
constexpr int kPoseSteps = 6;
constexpr double kConverged = 1e-9;

Eigen::Vector2d normal_of(const Eigen::Vector2d& side) {
  return Eigen::Vector2d(-side.y(), side.x()).normalized();
}

/// ∂ intersection of two lines / ∂ shift of each along its normal.
Eigen::Matrix2d corner_by_sides(const Eigen::Vector2d& before, const Eigen::Vector2d& after) {
  const double cross = before.x() * after.y() - before.y() * after.x();
  const double sine = std::copysign(std::max(std::abs(cross), kMinSine), cross);
  Eigen::Matrix2d out;
  out << after.y(), -before.y(), -after.x(), before.x();
  return out / sine;
}

/// Both poses that agree with the corners at the tag's centre to first order (IPPE, section 4). Not
/// finite when three corners are on one line.
std::array<Pose, 2> planar_poses(const TagObservation& tag, const CameraModel& camera) {
  Eigen::Matrix<double, 3, 4> corners;
  for (Eigen::Index i = 0; i < 4; ++i) {
    const Eigen::Vector2d& px = tag.corners_px[static_cast<std::size_t>(i)];
    corners.col(i) << (px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1;
  }
  // At their depths, up to a common factor, they are a parallelogram: P0 - P1 + P2 = P3.
  Eigen::Matrix3d first = corners.leftCols<3>();
  first.col(1) *= -1;
  corners.leftCols<3>() *= (first.inverse() * corners.col(3)).eval().asDiagonal();
  const Eigen::Vector3d centre = corners.rowwise().mean();
  const Eigen::Vector2d v = centre.head<2>() / centre.z();
  Eigen::Matrix<double, 3, 2> H;  // ∂ homogeneous image / ∂ point of the tag, at its centre
  H << corners.col(1) - corners.col(0), corners.col(3) - corners.col(0);
  H /= tag.edge_m * centre.z();
  // Axes with z towards the centre: there the image is the tag's plane, turned and scaled by depth.
  const auto q_VC = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), v.homogeneous());
  Eigen::Matrix<double, 2, 3> image;
  image << Eigen::Matrix2d::Identity(), -v;
  const Eigen::Matrix2d B = (image * q_VC.toRotationMatrix()).leftCols<2>();
  const Eigen::Matrix2d A = B.inverse() * (H.topRows<2>() - v * H.row(2));
  const double inverse_depth = A.operatorNorm();  // a rotation's block has norm 1
  Eigen::Matrix3d R_CT;
  R_CT.topLeftCorner<2, 2>() = A / inverse_depth;
  const Eigen::Matrix2d rest = Eigen::Matrix2d::Identity() -
                               R_CT.topLeftCorner<2, 2>().transpose() * R_CT.topLeftCorner<2, 2>();
  std::array<Pose, 2> poses;
  for (const std::size_t k : {0, 1}) {
    const double sign = k == 0 ? 1 : -1;
    R_CT(2, 0) = sign * std::sqrt(std::max(rest(0, 0), 0.0));
    R_CT(2, 1) = std::copysign(std::sqrt(std::max(rest(1, 1), 0.0)), sign * rest(0, 1));
    R_CT.col(2) = R_CT.col(0).cross(R_CT.col(1));
    poses[k] = {(q_VC * Eigen::Quaterniond(R_CT)).normalized(), v.homogeneous() / inverse_depth};
  }
  return poses;
}

/// Levenberg–Marquardt on the four corners; converges to the minimum near the start.
TagPose refine_pose(const TagObservation& tag, const CameraModel& camera, Pose X_VT) {
  CornerResidual residual = corner_residual(tag, X_VT, camera);
  if (!residual.in_front || !residual.y.allFinite())
    return {{}, std::numeric_limits<double>::infinity()};
  double damping = 1e-6;
  for (int i = 0; i < kPoseSteps; ++i) {
    Eigen::Matrix<double, 6, 6> A = residual.H.transpose() * residual.H;
    A.diagonal() *= 1.0 + damping;
    const Eigen::Matrix<double, 6, 1> d = A.ldlt().solve(residual.H.transpose() * residual.y);
    const Pose next{(exp_so3(d.tail<3>()) * X_VT.q).normalized(), X_VT.p + d.head<3>()};
    const CornerResidual tried = corner_residual(tag, next, camera);
    if (!tried.in_front || tried.y.squaredNorm() > residual.y.squaredNorm()) {
      damping = damping * 100 + 1e-3;
      if (damping > 1e6) break;
      continue;
    }
    X_VT = next;
    residual = tried;
    damping *= 0.1;
    if (d.norm() < kConverged) break;
  }
  return {X_VT, residual.rms_px()};
}

}  // namespace

TagOutline outline_of(const TagCorners& corners_px) {
  double doubled_area = 0;
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = corners_px[i];
    const Eigen::Vector2d& b = corners_px[(i + 1) % 4];
    longest = std::max(longest, (b - a).norm());
    doubled_area += a.x() * b.y() - b.x() * a.y();
  }
  return {longest, longest > 0 ? 0.5 * std::abs(doubled_area) / longest : 0.0};
}

PixelBox bounds_of(const TagCorners& corners_px) {
  PixelBox box{corners_px[0], corners_px[0]};
  for (const Eigen::Vector2d& px : corners_px) box = {box.low.cwiseMin(px), box.high.cwiseMax(px)};
  return box;
}

Eigen::Vector3d tag_corner(int i, double edge_m) {
  const double h = 0.5 * edge_m;
  return {(i == 1 || i == 2) ? h : -h, i >= 2 ? h : -h, 0.0};
}

CornerResidual corner_residual(const TagObservation& seen, const Pose& X_VT,
                               const CameraModel& camera, double size, double k1) {
  CornerResidual out;
  const Eigen::Matrix3d R_VT = X_VT.rotation();
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d arm = R_VT * tag_corner(i, size * seen.edge_m);
    const Eigen::Vector3d p = X_VT.p + arm;
    if (p.z() < kMinDepth_m) {
      out.in_front = false;
      return out;
    }
    const double iz = 1.0 / p.z();
    Eigen::Matrix<double, 2, 3> d_pixel_d_point;
    d_pixel_d_point << camera.fu * iz, 0, -camera.fu * p.x() * iz * iz,  //
        0, camera.fv * iz, -camera.fv * p.y() * iz * iz;
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Matrix2d raw_from_ideal = seen.ideal_from_raw[k].inverse();
    out.y.segment<2>(2 * i) = raw_from_ideal * (seen.corners_px[k] - camera.pinhole(p));
    Eigen::Matrix<double, 2, 3> J = raw_from_ideal * d_pixel_d_point;
    const FirstBend bend(camera, p.head<2>() * iz);
    const Eigen::Vector2d focal(camera.fu, camera.fv);
    out.H_k1.segment<2>(2 * i) = focal.cwiseProduct(bend.point());
    if (k1 != 0) {
      out.y.segment<2>(2 * i) -= k1 * out.H_k1.segment<2>(2 * i);
      J += k1 * (focal.asDiagonal() * bend.raw_from_ideal() * focal.cwiseInverse().asDiagonal()) *
           d_pixel_d_point;
    }
    out.H.block<2, 3>(2 * i, 0) = J;
    out.H.block<2, 3>(2 * i, 3) = -J * skew(arm);
    out.H_size.segment<2>(2 * i) = J * arm / size;
  }
  return out;
}

Matrix8d corner_covariance(const TagCorners& corners_px, const std::array<SideSigma, 4>& sides) {
  TagCorners normals;
  for (std::size_t i = 0; i < 4; ++i)
    normals[i] = normal_of(corners_px[(i + 1) % 4] - corners_px[i]);
  // ∂ corners / ∂ (shift of each side: even columns, turn: odd ones), in sigmas.
  Matrix8d by_sides = Matrix8d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t before = (i + 3) % 4;
    const auto row = static_cast<Eigen::Index>(2 * i);
    const auto of_before = static_cast<Eigen::Index>(2 * before);
    const Eigen::Matrix2d corner = corner_by_sides(normals[before], normals[i]);
    by_sides.block<2, 1>(row, of_before) = sides[before].shift_px * corner.col(0);
    by_sides.block<2, 1>(row, of_before + 1) = -sides[before].turn_px * corner.col(0);
    by_sides.block<2, 1>(row, row) = sides[i].shift_px * corner.col(1);
    by_sides.block<2, 1>(row, row + 1) = sides[i].turn_px * corner.col(1);
  }
  return by_sides * by_sides.transpose();
}

std::array<TagPose, 2> solve_tag_pose(const TagObservation& tag, const CameraModel& camera) {
  std::array<TagPose, 2> out;
  std::ranges::transform(planar_poses(tag, camera), out.begin(),
                         [&](const Pose& X_VT) { return refine_pose(tag, camera, X_VT); });
  if (out[1].rms_px < out[0].rms_px) std::swap(out[0], out[1]);
  if (!std::isfinite(out[1].rms_px)) out[1].X_VT = out[0].X_VT;
  return out;
}

Pose solve_tag_position(const TagObservation& tag, const CameraModel& camera,
                        const Eigen::Quaterniond& q_VT, const Eigen::Vector3d& p_VT) {
  Pose X_VT{q_VT, p_VT};
  for (int i = 0; i < kPoseSteps; ++i) {
    const CornerResidual residual = corner_residual(tag, X_VT, camera);
    if (!residual.in_front) return {q_VT, p_VT};
    const auto H = residual.H.leftCols<3>();
    const Eigen::Vector3d d = (H.transpose() * H).ldlt().solve(H.transpose() * residual.y);
    X_VT.p += d;
    if (d.norm() < kConverged) break;
  }
  return X_VT;
}

}  // namespace fiducap
