#pragma once

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "capture/odometry.hpp"
#include "estimation/estimator_config.hpp"
#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

inline constexpr Duration kSegmentLength = std::chrono::seconds(1);
/// Without a tag for longer, the next one is met anew: readings of minutes are no use.
inline constexpr Duration kLongestBlind = std::chrono::seconds(10);

/// What moves a body without IMU: white noise.
[[nodiscard]] InertialInput motion_without_imu(const EstimatorConfig& config);
/// Adds steps of at most `longest` under one reading.
void add_steps(Duration time, const InertialInput& input, Duration longest,
               std::vector<SegmentStep>& steps);

/// The steps from pose to pose of the odometry. @pre it covers both instants
void add_odometry(const Odometry& odometry, Instant from, Instant to,
                  std::vector<SegmentStep>& steps);

/// A body without IMU at an instant at which it saw tags.
struct PlacedInstant {
  Instant at{};
  Pose X_WB;
  std::vector<SegmentImage> images;
};

/// All that is to be cut, and what is known of it.
struct PlacedPath {
  int body_id{};
  int chain{};          ///< Of the first segment; later ones count on.
  bool anchored{true};  ///< Places are in the workspace.
  std::shared_ptr<const SegmentSensors> sensors;
  InertialInput motion;
  const Odometry* odometry{};  ///< How it moved, where that is known; nullptr: nowhere.
  std::vector<CameraBelief> cameras;
  std::map<int, KnownTag> tags;         ///< Sightings of others are left out.
  std::vector<PlacedInstant> instants;  ///< In order of time.
};

/// Segments of about a second for the map graph, from poses that were found otherwise than by a
/// filter. Velocities and rates are those between neighbours; the graph finds better ones. A chain
/// ends where no tag was seen for ten seconds and there is no odometry, and where that begins or
/// ends. An instant on its own is a segment, too.
[[nodiscard]] std::vector<MotionSegment> cut_segments(const PlacedPath& path);

}  // namespace fiducap
