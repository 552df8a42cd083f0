#pragma once

#include <cstddef>

/// Constants of the filter outside its equations.
namespace fiducap::filter_rules {

// Initial uncertainty, 1-sigma.
inline constexpr double kStartTilt_rad = 0.1;
inline constexpr double kStartBiasF_m_s2 = 0.2;
inline constexpr double kStartBiasW_rad_s = 0.02;
// The body is lost after this time without a used tag: IMU drift, or an uninformative motion model.
inline constexpr double kLostAfterWithImu_s = 10.0;
inline constexpr double kLostAfterWithoutImu_s = 1.0;
// Longest integration steps: rotation and force change little within them.
inline constexpr double kStepWithImu_s = 0.02;
inline constexpr double kStepWithoutImu_s = 0.05;
// Fewer image points than this cannot confirm each other (edges, partly visible tags).
inline constexpr std::size_t kFewestPoints = 10;
// An image with this many landmarks determines the motion with or without a tag.
inline constexpr int kLandmarksToStay = 3;
// An update far from the linearisation point, or after this time without an accepted tag, is
// iterated: drift makes one linearisation inaccurate by hundredths of a pixel.
inline constexpr int kFirstIterations = 5;
inline constexpr double kCoasted_s = 0.5;
inline constexpr int kCornerStepIterations = 2;
// Consecutive images with at least half of the usable tags rejected, before a jump of the camera's
// clock is assumed.
inline constexpr int kContradictionsToReopenClock = 5;
// Consecutive images with usable tags and none accepted, before tags are removed or the body is
// relocalised.
inline constexpr int kRejectedToRelocalise = 20;
// The same when all of them show a single tag, which may have been moved, and an IMU bridges it.
inline constexpr double kOneTagTimeout_s = 8.0;
// Sightings before a tag is accepted.
inline constexpr int kViewsToBelieve = 3;
// Images after which a pose branch is taken with little evidence because there is no other pose.
// With an IMU only: without one a wrong branch would never be noticed.
inline constexpr int kForceWithImu = 40;
// Without IMU an image gives no pose while a pose rotated by more than the angle costs less than
// this much more in chi-square: a single small tag after a pause does not.
inline constexpr double kOtherBranch_rad = 0.2;
inline constexpr double kEvidenceToFollow = 9.0;
// Largest chi-square of the motion implied by a single tag: beyond, the tag was moved.
inline constexpr double kMostSurprise = 100.0;
// Rotation error of the gyro integrated while the body is lost.
inline constexpr double kGyroTurn_rad = 0.1;

}  // namespace fiducap::filter_rules
