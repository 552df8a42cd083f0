#include "detection/plane_pose.hpp"

#include <opencv2/calib3d.hpp>

#include "base/assert.hpp"
#include "base/so3.hpp"

namespace fiducap {

std::vector<Pose> solve_plane_pose(std::span<const Eigen::Vector3d> points,
                                   std::span<const Eigen::Vector2d> raw_px,
                                   const CameraModel& camera) {
  FIDUCAP_ASSERT(points.size() == raw_px.size());
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> image;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto ideal = undistort(camera, raw_px[i]);
    if (!ideal) continue;
    object.emplace_back(points[i].x(), points[i].y(), 0.0);
    image.emplace_back((ideal->px.x() - camera.cu) / camera.fu,
                       (ideal->px.y() - camera.cv) / camera.fv);
  }
  if (object.size() < 4) return {};
  std::vector<cv::Mat> rvecs;
  std::vector<cv::Mat> tvecs;
  try {
    cv::solvePnPGeneric(object, image, cv::Matx33d::eye(), cv::noArray(), rvecs, tvecs, false,
                        cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
    return {};  // points on a line, or seen as one
  }
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < rvecs.size(); ++i) {
    const cv::Mat& r = rvecs[i];
    const cv::Mat& t = tvecs[i];
    const Pose X_VT{exp_so3({r.at<double>(0), r.at<double>(1), r.at<double>(2)}),
                    {t.at<double>(0), t.at<double>(1), t.at<double>(2)}};
    if (X_VT.p.allFinite() && X_VT.q.coeffs().allFinite() && X_VT.p.z() > 0) poses.push_back(X_VT);
  }
  return poses;
}

}  // namespace fiducap
