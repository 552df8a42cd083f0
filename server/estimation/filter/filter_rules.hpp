#pragma once

/// Constants of the filter that several files use.
namespace fiducap::filter_rules {

// Initial uncertainty, 1-sigma.
inline constexpr double kStartTilt_rad = 0.1;
inline constexpr double kStartBiasF_m_s2 = 0.2;
inline constexpr double kStartBiasW_rad_s = 0.02;
// Longest integration steps: rotation and force change little within them.
inline constexpr double kStepWithImu_s = 0.02;
inline constexpr double kStepWithoutImu_s = 0.05;
// Without IMU an image gives no pose while a pose rotated by more than the angle costs less than
// this much more in chi-square: a single small tag after a pause does not.
inline constexpr double kOtherBranch_rad = 0.2;
inline constexpr double kEvidenceToFollow = 9.0;
// An image with this many landmarks determines the motion with or without a tag.
inline constexpr int kLandmarksToStay = 3;
// Iterations of an update far from the linearisation point.
inline constexpr int kFirstIterations = 5;
// Scale of the Cauchy loss of a sighting in a batch: eight numbers of 5 sigma, squared.
inline constexpr double kLossBend = 8 * 5.0 * 5.0;
// Consecutive images with at least half of the usable tags rejected, before a jump of the camera's
// clock is assumed.
inline constexpr int kContradictionsToReopenClock = 5;
// Images after which a pose branch is taken with little evidence because there is no other pose.
// With an IMU only: without one a wrong branch would never be noticed.
inline constexpr int kForceWithImu = 40;

}  // namespace fiducap::filter_rules
