#include "detection/planar_target.hpp"

#include <algorithm>
#include <limits>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "base/expected.hpp"

namespace fiducap {
namespace {

/// Smallest distance between neighbours in a row or column.
double min_spacing(const std::vector<cv::Point2f>& corners, int columns) {
  double spacing = std::numeric_limits<double>::infinity();
  const auto n = static_cast<int>(corners.size());
  for (int i = 0; i < n; ++i) {
    const cv::Point2f& at = corners[static_cast<std::size_t>(i)];
    if ((i + 1) % columns != 0)
      spacing = std::min(spacing, cv::norm(corners[static_cast<std::size_t>(i + 1)] - at));
    if (i + columns < n)
      spacing = std::min(spacing, cv::norm(corners[static_cast<std::size_t>(i + columns)] - at));
  }
  return spacing;
}

/// Moves corners to the saddle points of the pixels around them: 0.050 px instead of 0.084 px on
/// rendered pictures, without a bias of 5 sigma in the focal length. The window stays inside the
/// four squares that meet.
void refine_corners(const cv::Mat& pixels, int columns, std::vector<cv::Point2f>& corners) {
  constexpr double kShareOfSquare = 0.4;
  const int half =
      std::clamp(static_cast<int>(kShareOfSquare * min_spacing(corners, columns)), 2, 12);
  cv::cornerSubPix(pixels, corners, cv::Size(half, half), cv::Size(-1, -1),
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-3});
}

}  // namespace

std::optional<std::vector<Eigen::Vector2d>> find_checkerboard(const GrayImage& image, int columns,
                                                              int rows) {
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  std::vector<cv::Point2f> found;
  try {
    if (!cv::findChessboardCornersSB(pixels, cv::Size(columns, rows), found,
                                     cv::CALIB_CB_NORMALIZE_IMAGE) ||
        found.size() != static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows))
      return std::nullopt;
    refine_corners(pixels, columns, found);
  } catch (const cv::Exception&) {
    return std::nullopt;  // the image is too small for such a board
  }
  std::vector<Eigen::Vector2d> corners;
  for (const cv::Point2f& p : found) corners.emplace_back(p.x, p.y);
  return corners;
}

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
    return {};  // collinear points
  }
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < rvecs.size(); ++i) {
    const Pose X_VT{exp_so3(Eigen::Vector3d(rvecs[i].ptr<double>())),
                    Eigen::Vector3d(tvecs[i].ptr<double>())};
    if (X_VT.p.allFinite() && X_VT.q.coeffs().allFinite() && X_VT.p.z() > 0) poses.push_back(X_VT);
  }
  return poses;
}

}  // namespace fiducap
