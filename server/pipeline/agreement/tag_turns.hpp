#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Geometry>

#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// How a camera turned between two of its images, by tags that both show, wherever they hang.
struct CameraTurn {
  Eigen::Vector3d turn_V{Eigen::Vector3d::Zero()};  ///< Rotation vector, camera axes.
  double sigma_rad{};                               ///< Per axis, as the corners' noise explains.
};

/// The largest tags of one image, to be compared with those of another one.
struct Look {
  static constexpr std::size_t kTags = 4;

  Instant at{};  ///< As stamped, without what a filter has learned of the clock.
  std::array<TagObservation, kTags> tags;
  std::size_t count{0};

  void take(const TagObservations& seen);
};

/// Two tags at most are asked, the largest first; if they do not say the same, nothing is said. A
/// tag alone is asked only where its two planar poses turn alike, or one is clearly wrong.
/// @param corner_noise_px  of tags that do not tell theirs
[[nodiscard]] std::optional<CameraTurn> turn_between(const Look& before, const Look& after,
                                                     const CameraModel& camera,
                                                     double corner_noise_px);

}  // namespace fiducap
