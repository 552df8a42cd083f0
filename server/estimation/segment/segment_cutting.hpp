#pragma once

#include <map>
#include <span>
#include <vector>

#include "capture/recording/odometry.hpp"
#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

inline constexpr Duration kSegmentLength = std::chrono::seconds(1);
/// Longest time without a tag within a chain.
inline constexpr Duration kLongestBlind = std::chrono::seconds(10);

/// Appends steps of at most `longest` with one input.
void add_steps(Duration time, const InertialInput& input, Duration longest,
               std::vector<SegmentStep>& steps);

/// Appends the steps between the odometry's poses. @pre it covers both instants
void add_odometry(const Odometry& odometry, Instant from, Instant to,
                  std::vector<SegmentStep>& steps);

/// Drops sightings of tags without a place, and images without other tags. Sets the tags of the
/// segment.
void keep_placed(const std::map<int, KnownTag>& places, MotionSegment& segment);

/// Pose and images of a body without IMU at one instant.
struct PlacedInstant {
  Instant at{};
  Pose X_WB;
  std::vector<SegmentImage> images;
};

/// Input of cut_segments().
struct PlacedPath {
  MotionSegment head;  ///< Body, first chain, anchored, sensors, cameras of all segments.
  InertialInput motion;
  const Odometry* odometry{};           ///< nullptr: none.
  std::map<int, KnownTag> tags;         ///< Sightings of others are dropped.
  std::vector<PlacedInstant> instants;  ///< In order of time.
};

/// Segments of about a second for the map graph, from poses that are not a filter's. Velocities and
/// rates are differences of neighbours; the graph improves them. A chain ends after ten seconds
/// without a tag and odometry, and at the ends of odometry. A single instant is a segment, too.
[[nodiscard]] std::vector<MotionSegment> cut_segments(const PlacedPath& path);

}  // namespace fiducap
