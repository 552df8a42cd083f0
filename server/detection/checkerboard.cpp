#include "detection/checkerboard.hpp"

#include <opencv2/calib3d.hpp>

namespace fiducap {

std::optional<std::vector<Eigen::Vector2d>> find_checkerboard(const GrayImage& image, int columns,
                                                              int rows) {
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  std::vector<cv::Point2f> found;
  try {
    if (!cv::findChessboardCornersSB(pixels, cv::Size(columns, rows), found,
                                     cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY))
      return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // an image too small for such a board
  }
  std::vector<Eigen::Vector2d> corners;
  for (const cv::Point2f& p : found) corners.emplace_back(p.x, p.y);
  if (corners.size() != static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows))
    return std::nullopt;
  return corners;
}

}  // namespace fiducap
