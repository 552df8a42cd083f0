#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/start/place_search.hpp"

namespace fiducap {

/// Tests whether images that contradict a filter fit at another time: then their camera's clock has
/// jumped.
///
/// For each time shift the directions of the tags' corners by the IMU's path over the last seconds
/// are compared with the measured ones. Allocates nothing after construction.
class JumpSearch final {
 public:
  JumpSearch();

  /// Adds a pose by the IMU, in order of time. Old ones are dropped.
  void note_motion(Instant at, const Pose& X_AB);
  /// Adds a contradicting image. @param stamp  of the device @param tags  at known poses
  void note_image(int camera, Instant stamp, std::span<const SightedTag> tags);
  void forget_images() { images_ = 0; }
  void forget_all() { moments_ = images_ = 0; }

  struct Found {
    double shift_s{};   ///< The images were exposed this much later.
    bool is_certain{};  ///< False: a single moved tag would look the same so far.
  };
  /// @param known  shift already added to the camera's stamps
  /// @return nullopt: no shift fits, or several do
  [[nodiscard]] std::optional<Found> find(int camera, Duration known) const;

 private:
  static constexpr std::size_t kMotions = 320;  ///< 3.2 s.
  static constexpr double kMotionPeriod_s = 0.01;
  static constexpr std::size_t kImages = 24;
  static constexpr std::size_t kCorners = 12;

  struct Moment {
    Instant at{};
    Pose X_AB;
  };
  struct Image {
    int camera{};
    Instant stamp{};
    Pose X_BV;
    std::size_t corners{0};
    int tag_id{-1};  ///< Of the first tag.
    std::array<Eigen::Vector3d, kCorners> point_A;
    std::array<Eigen::Vector3d, kCorners> ray_V;  ///< Unit length.
  };

  [[nodiscard]] std::span<const Image> remembered() const {
    return std::span(ring_).first(std::min(images_, kImages));
  }
  [[nodiscard]] bool is_one_tag(int camera) const;
  [[nodiscard]] double misfit_of_moved_tag(int camera, Duration known) const;
  [[nodiscard]] std::optional<Pose> body_at(Instant at) const;
  [[nodiscard]] std::optional<double> misfit(int camera, Duration shift) const;

  std::vector<Moment> motions_;  ///< A ring.
  std::size_t moments_{0};       ///< Ever added.
  std::vector<Image> ring_;
  std::size_t images_{0};
};

}  // namespace fiducap
