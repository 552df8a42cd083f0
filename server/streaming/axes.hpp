#pragma once

#include <Eigen/Core>

#include "base/pose.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// Which way is up for a client. Inside it is always z.
enum class UpAxis { kZ, kY };
/// What turns with the world: only the world axes (q' = F q), or the body's own axes too (q' = F q F*).
enum class AxesScope { kWorld, kWorldAndBody };

/// One client's conventions. Units, axes and quaternion order are changed here and nowhere else,
/// position + attitude + twist + covariance together.
struct OutputAxes {
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  double units_per_m{1.0};  ///< 1 metres, 1000 millimetres.
};

/// The pose, velocity, rate, acceleration and covariance in the client's axes and units.
[[nodiscard]] BodyPose to_client(const BodyPose& body, const OutputAxes& axes);

}  // namespace fiducap
