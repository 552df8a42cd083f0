#pragma once

#include "base/pose.hpp"
#include "base/time.hpp"

namespace fiducap {

/// Where a body was at one instant.
struct StampedPose {
  Instant at{};
  Pose X_WB;
};

}  // namespace fiducap
