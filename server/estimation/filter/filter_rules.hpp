#pragma once

#include <cstddef>

namespace fiducap {

/// What both filters go by outside their mathematics.
namespace filter_rules {

// How little is known at the start, 1-sigma.
inline constexpr double kStartTilt_rad = 0.1;
inline constexpr double kStartBiasF_m_s2 = 0.2;
inline constexpr double kStartBiasW_rad_s = 0.02;
// After this long without a used tag the motion counts as unknown: IMU drift, or a motion model
// that knows nothing.
inline constexpr double kAdriftWithImu_s = 10.0;
inline constexpr double kAdriftWithoutImu_s = 1.0;
// Longest inertial steps: rotation and force change little within them.
inline constexpr double kStepWithImu_s = 0.02;
inline constexpr double kStepWithoutImu_s = 0.05;
// Fewer points than this cannot confirm each other: a bare room's few, on edges and half-seen
// tags, do more harm than good.
inline constexpr std::size_t kFewestPoints = 10;
// An image with so many landmarks says how the body moved, with or without a tag.
inline constexpr int kLandmarksToStay = 3;
// An update far from the linearisation point is iterated, as after so long without a fit: what the
// body has drifted is more than one line can tell to hundredths of a pixel.
inline constexpr int kFirstIterations = 5;
inline constexpr double kCoasted_s = 0.5;
inline constexpr int kCornerStepIterations = 2;
// Images in a row in which at least half of the usable tags contradict, before the camera's clock
// is thought to have jumped.
inline constexpr int kContradictionsToReopenClock = 5;
// Images in a row with usable tags and none accepted, before tags are given up, or the body is
// looked for anew …
inline constexpr int kRejectedToRelocalise = 20;
// … but not so soon when they all show one and the same tag, which may just have been moved, and an
// IMU bridges the time.
inline constexpr double kOneTagPatience_s = 8.0;
// A tag is believed to be there after so many views.
inline constexpr int kViewsToBelieve = 3;
// Images after which a branch is taken although the evidence is thin, because there is no pose
// otherwise. With an IMU only: without one nothing would ever show that it was wrong.
inline constexpr int kForceWithImu = 40;
// Without an IMU an image does not say where the body is while an answer turned by so much costs
// less than so much more: after a pause one small tag alone does not.
inline constexpr double kOtherBranch_rad = 0.2;
inline constexpr double kEvidenceToFollow = 9.0;
// Nor does one tag alone when the body would have had to move so much more than it does, in
// chi-square: the tag was moved.
inline constexpr double kMostSurprise = 100.0;
// After being adrift the gyro still says how the body turned.
inline constexpr double kGyroTurn_rad = 0.1;

}  // namespace filter_rules
}  // namespace fiducap
