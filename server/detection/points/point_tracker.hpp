#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "capture/camera_frame.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/points/feature_points.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// One point in two images of a camera that rotated by a known angle in between.
struct RotatedPair {
  Eigen::Vector3d before;  ///< Ray (x, y, 1) in the earlier camera's axes.
  Eigen::Vector3d now;     ///< The later camera's, rotated into the earlier axes.
};

/// Finds the pairs that fit one translation of the camera in a static scene. Two pairs give a
/// hypothesis of its direction (C. Troiani, A. Martinelli, C. Laugier, D. Scaramuzza,
/// "2-point-based outlier rejection for camera-IMU systems", ICRA 2014); the one with the most
/// inliers is used. Deterministic: hypotheses are drawn from a fixed sequence.
class TranslationConsensus final {
 public:
  /// @param usual  number of pairs to reserve memory for
  explicit TranslationConsensus(std::size_t usual = 0);

  /// @param limit  largest distance from the epipolar line, in units of the rays' x and y
  /// @return per pair 1 for an inlier, else 0; all 1 for fewer than five. Valid until the next
  /// call.
  std::span<const char> inliers(std::span<const RotatedPair> pairs, double limit);

 private:
  std::vector<Eigen::Vector3d> normals_;
  std::vector<char> fits_;
  std::vector<char> best_;
};

/// Tracks up to kMost corners from image to image, spread over the image. Works on raw images;
/// undistorts only the points.
///
/// Keeps the last image (shared, not copied) and two smaller copies of it. One per camera.
/// Allocates nothing after the first images.
class PointTracker final {
 public:
  static constexpr int kColumns = 10;
  static constexpr int kRows = 6;
  static constexpr std::size_t kMost = kColumns * kRows;
  /// Points are tracked in every image and reported in every second one, which carries nearly the
  /// same information.
  static constexpr int kReportEvery = 2;

  PointTracker();

  /// Tracks all points into this image, and starts new ones in empty cells of the grid.
  /// @param q_beforeNow  rotation of the camera since the last image (its axes now in its axes
  ///                     then); nullopt: unknown, moving points are not dropped
  /// @param tags         of this image: points on them are dropped
  /// @return sorted by track; empty in images between reports. Valid until the next call.
  std::span<const PointSighting> follow(const CameraFrame& frame, const CameraModel& model,
                                        const std::optional<Eigen::Quaterniond>& q_beforeNow,
                                        std::span<const TagSighting> tags);

 private:
  struct Point {
    std::uint32_t track{};
    int reports{0};
    Eigen::Vector2d raw_px;
    Eigen::Vector2d ideal_px;
  };
  void take_quads(std::span<const TagSighting> tags);
  [[nodiscard]] bool on_tag(const Eigen::Vector2d& px) const;
  void follow_all(const CameraModel& model, const std::optional<Eigen::Quaterniond>& q_beforeNow);
  bool follow_one(Point& point, const CameraModel& model,
                  const std::optional<Eigen::Quaterniond>& q_beforeNow);
  void drop_moving(const CameraModel& model, const Eigen::Quaterniond& q_beforeNow);
  void begin_new(const CameraModel& model);
  /// Of the first `count` points.
  [[nodiscard]] bool is_near_point(const Eigen::Vector2d& px, double distance_px,
                                   std::size_t count) const;
  std::span<const PointSighting> report();

  ImagePyramid before_;
  ImagePyramid now_;
  std::vector<Point> points_;  ///< By track: old ones first.
  std::vector<Eigen::Vector2d> ideal_before_;
  std::vector<RotatedPair> pairs_;
  std::vector<TagCorners> quads_;
  CornerFinder corners_;
  TranslationConsensus consensus_{kMost};
  std::vector<PointSighting> out_;
  std::uint32_t next_track_{1};
  int next_cell_{0};
  int images_{0};
};

}  // namespace fiducap
