#include "detection/tag_pose.hpp"

#include <Eigen/Cholesky>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "base/so3.hpp"

namespace fiducap {

namespace {

constexpr int kPolishSteps = 6;
constexpr double kConverged = 1e-9;

// IPPE_SQUARE wants upper-left, upper-right, lower-right, lower-left.
constexpr std::array<std::size_t, 4> kIppeOrder{3, 2, 1, 0};

/// Gauss–Newton on the four corners with a little damping: stays in its branch, ends at its least
/// squares pose.
TagPose polish(const TagObservation& tag, const CameraModel& camera, Pose X_VT) {
  CornerResidual residual = corner_residual(tag, X_VT, camera);
  if (!residual.in_front) return {X_VT, std::numeric_limits<double>::infinity()};
  double damping = 1e-6;
  for (int i = 0; i < kPolishSteps; ++i) {
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

Pose to_pose(const cv::Mat& rvec, const cv::Mat& tvec) {
  return {exp_so3({rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2)}),
          {tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2)}};
}

}  // namespace

std::array<TagPose, 2> solve_tag_pose(const TagObservation& tag, const CameraModel& camera) {
  std::array<cv::Point3d, 4> object;
  std::array<cv::Point2d, 4> image;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d corner = tag_corner(static_cast<int>(kIppeOrder[i]), tag.edge_m);
    object[i] = {corner.x(), corner.y(), corner.z()};
    const Eigen::Vector2d& px = tag.corners_px[kIppeOrder[i]];
    image[i] = {(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv};
  }
  const cv::Mat objects(4, 1, CV_64FC3, object.data());
  const cv::Mat images(4, 1, CV_64FC2, image.data());
  std::vector<cv::Mat> rvecs;
  std::vector<cv::Mat> tvecs;
  cv::solvePnPGeneric(objects, images, cv::Matx33d::eye(), cv::noArray(), rvecs, tvecs, false,
                      cv::SOLVEPNP_IPPE_SQUARE);

  std::array<TagPose, 2> out;
  out.fill({Pose{}, std::numeric_limits<double>::infinity()});
  for (std::size_t i = 0; i < std::min<std::size_t>(2, rvecs.size()); ++i) {
    out[i] = polish(tag, camera, to_pose(rvecs[i], tvecs[i]));
  }
  if (out[1].rms_px < out[0].rms_px) std::swap(out[0], out[1]);
  if (!std::isfinite(out[1].rms_px)) out[1].X_VT = out[0].X_VT;
  return out;
}

Pose place_turned_tag(const TagObservation& tag, const CameraModel& camera,
                      const Eigen::Quaterniond& q_VT, const Eigen::Vector3d& p_VT) {
  Pose X_VT{q_VT, p_VT};
  for (int i = 0; i < kPolishSteps; ++i) {
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
