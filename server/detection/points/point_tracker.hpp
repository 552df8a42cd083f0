#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "capture/camera_frame.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/points/corner_finder.hpp"
#include "detection/points/image_pyramid.hpp"
#include "detection/points/motion_check.hpp"

namespace fiducap {

/// What became of the points of one camera. Never reset.
struct PointStatistics {
  std::uint64_t images{};
  std::uint64_t followed{};  ///< From one image to the next.
  std::uint64_t lost{};      ///< Not found again, or out of the image.
  std::uint64_t not_back{};  ///< The way back led elsewhere.
  std::uint64_t on_tags{};   ///< Hidden by a tag, or its own.
  std::uint64_t moving{};    ///< Did not fit the motion of the rest.
  std::uint64_t begun{};
};

/// Follows corners of whatever the camera sees from image to image, spread over the image, never
/// more than kMost. Looks only at raw images; the lens is taken out of the points alone.
///
/// Keeps the last image (shared, not copied) and two smaller copies of it. One per camera.
/// Allocates nothing after the first images.
class PointTracker final {
 public:
  static constexpr int kColumns = 10;
  static constexpr int kRows = 6;
  static constexpr std::size_t kMost = kColumns * kRows;
  /// Points are followed in every image and given out in every so-manieth: what one image adds to
  /// its neighbours is little, what a longer stretch adds is much.
  static constexpr int kReportEvery = 2;

  PointTracker();

  /// Follows all points into this image, and begins new ones where there are none.
  /// @param q_beforeNow  how the camera turned since the last image given here (its axes now in its
  /// axes then); nullopt:
  ///                     not known, and then a point that moves on its own is not noticed
  /// @param tags         seen in this image: points on them are dropped
  /// @return sorted by track; empty in images between reports. Valid until the next call.
  std::span<const PointSighting> follow(const CameraFrame& frame, const CameraModel& model,
                                        const std::optional<Eigen::Quaterniond>& q_beforeNow,
                                        std::span<const TagSighting> tags);
  [[nodiscard]] const PointStatistics& statistics() const { return statistics_; }

 private:
  struct Point {
    std::uint32_t track{};
    int reports{0};
    Eigen::Vector2d raw_px;
    Eigen::Vector2d ideal_px;
  };
  struct Quad {
    std::array<Eigen::Vector2d, 4> corners_px;
  };

  void take_quads(std::span<const TagSighting> tags);
  [[nodiscard]] bool on_tag(const Eigen::Vector2d& px) const;
  void follow_all(const CameraModel& model, const std::optional<Eigen::Quaterniond>& q_beforeNow);
  bool follow_one(Point& point, const CameraModel& model,
                  const std::optional<Eigen::Quaterniond>& q_beforeNow);
  void drop_moving(const CameraModel& model, const Eigen::Quaterniond& q_beforeNow);
  void drop_crowded();
  void begin_new(const CameraModel& model);
  [[nodiscard]] bool may_begin(int u, int v) const;
  std::span<const PointSighting> report();

  ImagePyramid before_;
  ImagePyramid now_;
  std::vector<Point> points_;  ///< By track: old ones first.
  std::vector<Eigen::Vector2d> ideal_before_;
  std::vector<TurnedPair> pairs_;
  std::vector<Quad> quads_;
  CornerFinder corners_;
  MotionCheck motion_{kMost};
  std::vector<PointSighting> out_;
  std::uint32_t next_track_{1};
  int next_cell_{0};
  int images_{0};
  PointStatistics statistics_;
};

}  // namespace fiducap
