#include "estimation/checks/size_check.hpp"

#include <gtest/gtest.h>

#include <map>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_geometry.hpp"
#include "known_motion.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

constexpr double kEdge_m = 0.3;
constexpr double kCornerNoise_px = 0.2;
// Corners are exact here; what is left is what a look leaves open and the tilt of wrong extrinsics.
constexpr double kExact = 0.01;

/// A camera that looks up at tags under the ceiling and is waved about; all that a filter would say
/// is the truth.
class SizeCheckTest : public testing::Test {
 protected:
  SizeCheckTest() {
    CameraMount mount;
    mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    mount.X_BV = {exp_so3({0.02, -0.03, 0.1}), {0.05, -0.02, 0.03}};
    configured_.cameras = {mount};
    configured_.imu = ImuNoise{};
    configured_.gravity_m_s2 = kGravity;
    const std::array<Eigen::Vector3d, 3> at{{{0, 0, 4}, {1, 0.4, 3.5}, {-0.8, 0.6, 4.5}}};
    for (int i = 0; i < 3; ++i) {
      const Eigen::Quaterniond down = exp_so3({3.1, 0.2 * i, 0.1});
      tags_[i] = {down, at[static_cast<std::size_t>(i)]};
    }
  }

  // Turned little, so that the tags stay in front.
  static Eigen::Vector3d turn(double t) {
    return 0.25 * Eigen::Vector3d(std::sin(1.1 * t), std::sin(1.6 * t + 0.5), std::sin(0.9 * t));
  }
  [[nodiscard]] Eigen::Vector3d place(double t) const { return amplitude_ * Motion::p(t); }
  [[nodiscard]] Pose X_WB(double t) const { return {exp_so3(turn(t)), place(t)}; }
  [[nodiscard]] ImuSample imu(double t) const {
    constexpr double h = 1e-5;
    const Eigen::Vector3d w = right_jacobian_so3(turn(t)) * ((turn(t + h) - turn(t - h)) / (2 * h));
    return {at_s(t), w,
            exp_so3(turn(t)).conjugate() *
                (amplitude_ * Motion::a(t) + Eigen::Vector3d(0, 0, kGravity))};
  }
  [[nodiscard]] TagObservations image(double t, const Pose& X_BV) const {
    TagObservations seen;
    seen.exposed_at = at_s(t);
    const CameraModel& model = configured_.cameras.front().model;
    for (const auto& [id, X_WT] : tags_) {
      TagObservation tag;
      tag.tag_id = id;
      const auto ratio = printed_.find(id);
      tag.edge_m = kEdge_m / (ratio == printed_.end() ? 1.0 : ratio->second);
      tag.ideal_from_raw.fill(Eigen::Matrix2d::Identity());
      const CameraModel lens = true_lens_.applied_to(model);
      for (int i = 0; i < 4; ++i) {
        const auto k = static_cast<std::size_t>(i);
        tag.raw_px[k] =
            *lens.project((X_WB(t + late_s_) * X_BV).inverse() * (X_WT * tag_corner(i, kEdge_m)));
        tag.corners_px[k] = tag.raw_px[k];  // configured as a lens without distortion
      }
      seen.tags.push_back(tag);
    }
    return seen;
  }

  /// Runs for the seconds. @return all findings
  std::vector<SizeFinding> run(SizeCheck& check, double seconds, double from = 0) {
    std::vector<SizeFinding> findings;
    const Pose X_BV = true_X_BV_.value_or(configured_.cameras.front().X_BV);
    std::vector<TagBelief> own;
    for (const auto& [id, X_WT] : tags_) {
      TagBelief belief;
      belief.tag.tag_id = id;
      belief.tag.X_WT = X_WT;
      own.push_back(belief);
    }
    for (int k = static_cast<int>(from * 200); k <= static_cast<int>((from + seconds) * 200); ++k) {
      const double t = 0.005 * k;
      check.add(imu(t));
      if (k % 10 != 0) continue;
      const TagObservations seen = image(t, X_BV);
      BodyEstimate estimate;
      estimate.at = seen.exposed_at;
      estimate.X_WB = X_WB(t);
      estimate.X_WB.p *= filter_scale_;
      estimate.covariance = 1e-6 * Matrix15d::Identity();
      UpdateReport report;
      report.tags_used = static_cast<int>(seen.tags.size());
      before_ = g_allocations;
      check.add({seen, estimate, report, own, {}});
      allocated_ += g_allocations - before_;
      if (const auto found = check.take_event()) findings.push_back(*found);
    }
    return findings;
  }
  std::vector<SizeFinding> run(double seconds) {
    SizeCheck check(configured_, kCornerNoise_px);
    return run(check, seconds);
  }

  BodySensors configured_;
  std::map<int, Pose> tags_;
  std::map<int, double> printed_;  ///< printed / configured
  std::optional<Pose> true_X_BV_;  ///< nullopt: as configured
  LensOffset true_lens_{};         ///< Against what is configured.
  double amplitude_{1};
  double late_s_{0};        ///< Delay of the images against their stamps.
  double filter_scale_{1};  ///< Of the positions in the filter.
  std::uint64_t before_{0};
  std::uint64_t allocated_{0};
};

TEST_F(SizeCheckTest, DoesNotReportRightSizes) {
  SizeCheck check(configured_, kCornerNoise_px);
  EXPECT_TRUE(run(check, 60).empty());
  ASSERT_TRUE(check.common());
  EXPECT_NEAR(check.common()->value, 0, kExact);
  EXPECT_NEAR(check.of_tag(1, true)->value, 0, kExact);
  EXPECT_NEAR(check.of_tag(1, false)->value, 0, kExact);
}

TEST_F(SizeCheckTest, ReportsOnceThatAllSizesAreWrong) {
  for (const double ratio : {0.8, 0.9, 1.1, 1.25}) {
    printed_ = {{0, ratio}, {1, ratio}, {2, ratio}};
    filter_scale_ = 1 / ratio;  // it follows the tags
    const auto findings = run(40);
    ASSERT_EQ(findings.size(), 1u) << ratio;
    EXPECT_FALSE(findings.front().tag_id);
    EXPECT_NEAR(findings.front().ratio, ratio, kExact * ratio);
  }
}

TEST_F(SizeCheckTest, ReportsTheOneTagWithWrongSize) {
  printed_ = {{1, 1.1}};
  const auto findings = run(40);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings.front().tag_id, 1);
  EXPECT_NEAR(findings.front().ratio, 1.1, kExact);
  EXPECT_NEAR(findings.front().edge_m, kEdge_m / 1.1, 1e-12);
}

TEST_F(SizeCheckTest, ReportsEveryTagWithWrongSizeWorstFirst) {
  tags_[3] = {tags_[0].q, {0.5, -0.9, 4.2}};
  tags_[4] = {tags_[1].q, {-0.4, -0.5, 3.8}};
  printed_ = {{1, 1.1}, {3, 0.8}};
  const auto findings = run(40);
  ASSERT_EQ(findings.size(), 2u);
  EXPECT_EQ(findings[0].tag_id, 3);
  EXPECT_NEAR(findings[0].ratio, 0.8, kExact);
  EXPECT_EQ(findings[1].tag_id, 1);
  EXPECT_NEAR(findings[1].ratio, 1.1, kExact);
}

TEST_F(SizeCheckTest, ReportsItWithoutImuByTheOtherTags) {
  configured_.imu.reset();
  printed_ = {{2, 0.9}};
  const auto findings = run(40);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings.front().tag_id, 2);
  EXPECT_NEAR(findings.front().ratio, 0.9, kExact);
}

TEST_F(SizeCheckTest, ReportsNothingWithoutImuWhenAllSizesAreWrong) {
  configured_.imu.reset();
  printed_ = {{0, 1.25}, {1, 1.25}, {2, 1.25}};
  filter_scale_ = 1 / 1.25;
  EXPECT_TRUE(run(40).empty());
}

TEST_F(SizeCheckTest, DoesNotReportTheErrorOfATapeMeasure) {
  printed_ = {{0, 1.03}, {1, 1.03}};
  EXPECT_TRUE(run(40).empty());
}

TEST_F(SizeCheckTest, ReportsNothingWhenTheBodyHardlyMoves) {
  amplitude_ = 0.002;
  printed_ = {{0, 1.25}, {1, 1.25}, {2, 1.25}};
  filter_scale_ = 1 / 1.25;
  EXPECT_TRUE(run(40).empty());
}

TEST_F(SizeCheckTest, IsRobustToWrongExtrinsics) {
  configured_.cameras.front().position_sigma_m = 0.05;
  configured_.cameras.front().rotation_sigma_rad = 0.05;
  true_X_BV_ =
      configured_.cameras.front().X_BV * Pose{exp_so3({0.04, -0.05, 0.03}), {0.04, -0.03, 0.05}};
  SizeCheck check(configured_, kCornerNoise_px);
  EXPECT_TRUE(run(check, 40).empty());
  EXPECT_NEAR(check.common()->value, 0, 2 * kExact);
}

TEST_F(SizeCheckTest, UsesTheLearnedLens) {
  true_lens_.k1 = -0.3;
  SizeCheck configured(configured_, kCornerNoise_px);
  run(configured, 20);
  ASSERT_TRUE(configured.common());
  SizeCheck learned(configured_, kCornerNoise_px);
  learned.set_lens(0, true_lens_);
  EXPECT_TRUE(run(learned, 20).empty());
  ASSERT_TRUE(learned.common());
  EXPECT_GT(std::abs(configured.common()->value), kExact) << "the tags are near the axis";
  EXPECT_LT(std::abs(learned.common()->value), 0.1 * kExact);
}

TEST_F(SizeCheckTest, IsRobustToAClockError) {
  for (const double late_s : {-0.02, 0.02}) {
    late_s_ = late_s;
    SizeCheck check(configured_, kCornerNoise_px);
    EXPECT_TRUE(run(check, 40).empty());
    EXPECT_NEAR(check.common()->value, 0, 2 * kExact);
  }
}

TEST_F(SizeCheckTest, IsRobustToAMovedTag) {
  SizeCheck check(configured_, kCornerNoise_px);
  EXPECT_TRUE(run(check, 21).empty());
  tags_[1].p += Eigen::Vector3d(0.2, 0.2, 0.1);
  EXPECT_TRUE(run(check, 40, 21.05).empty());
}

TEST_F(SizeCheckTest, AllocatesNothingAfterTheFirstLooks) {
  SizeCheck check(configured_, kCornerNoise_px);
  run(check, 5);
  allocated_ = 0;
  run(check, 10, 5.05);
  EXPECT_EQ(allocated_, 0u);
}

}  // namespace
}  // namespace fiducap
