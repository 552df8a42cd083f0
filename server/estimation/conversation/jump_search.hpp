#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/start/resection.hpp"

namespace fiducap {

/// Whether images that contradict a filter show what was to be seen some tenths of a second before
/// or after: then their camera's clock has jumped.
///
/// The readings say where the body was over the last seconds, whatever the images say. For each
/// shift the directions in which the tags' corners should have been seen are compared with those in
/// which they were. Allocates nothing after construction.
class JumpSearch final {
 public:
  JumpSearch();

  /// Where the body was by the readings. In order of time; what is older falls out.
  void note_motion(Instant at, const Pose& X_AB);
  /// An image that contradicts. @param stamp  the device's @param tags  at known places
  void note_image(int camera, Instant stamp, std::span<const SightedTag> tags);
  /// Other images are to be told apart from those before.
  void forget_images() { images_ = 0; }
  void forget_all();

  struct Found {
    double shift_s{};   ///< By how much later than was known the images were exposed.
    bool is_certain{};  ///< False: one tag that was moved would look the same so far.
  };
  /// nullopt: no shift explains the camera's images, or several do.
  /// @param known  what is added to the camera's stamps already
  [[nodiscard]] std::optional<Found> find(int camera, Duration known) const;

 private:
  static constexpr std::size_t kMotions = 320;  ///< 3.2 s …
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
    int tag_id{-1};  ///< The first one's.
    std::array<Eigen::Vector3d, kCorners> point_A;
    std::array<Eigen::Vector3d, kCorners> ray_V;  ///< Unit length.
  };

  [[nodiscard]] bool is_one_tag(int camera) const;
  [[nodiscard]] double misfit_of_moved_tag(int camera, Duration known) const;
  [[nodiscard]] std::optional<Pose> body_at(Instant at) const;
  [[nodiscard]] std::optional<double> misfit(int camera, Duration shift) const;

  std::vector<Moment> motions_;  ///< A ring …
  std::size_t moments_{0};       ///< … and how many were ever put into it.
  std::vector<Image> ring_;
  std::size_t images_{0};
};

}  // namespace fiducap
