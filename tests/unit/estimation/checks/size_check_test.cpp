#include "estimation/checks/size_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>
#include <utility>

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

/// A camera that looks up at tags under the ceiling and is waved about; the filter's estimates are
/// the truth.
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
  std::vector<SizeFinding> run(double seconds, double from = 0) {
    if (!check_) check_.emplace(configured_, kCornerNoise_px);
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
      check_->add(imu(t));
      if (k % 10 != 0) continue;
      const TagObservations seen = image(t, X_BV);
      BodyEstimate estimate;
      estimate.at = seen.exposed_at;
      estimate.X_WB = X_WB(t);
      estimate.X_WB.p *= filter_scale_;
      estimate.covariance = 1e-6 * Matrix15d::Identity();
      UpdateReport report;
      report.tags_used = static_cast<int>(seen.tags.size());
      const AllocationCounter allocations;
      check_->add({seen, estimate, report, own, {}});
      allocated_ += allocations.count();
      if (const auto found = check_->take_event()) findings.push_back(*found);
    }
    return findings;
  }
  /// Expects findings of these tags with these ratios, in this order.
  void expect_findings(const std::vector<std::pair<int, double>>& expected) {
    const auto findings = run(40);
    ASSERT_EQ(findings.size(), expected.size());
    for (std::size_t i = 0; i < findings.size(); ++i) {
      EXPECT_EQ(findings[i].tag_id, expected[i].first);
      EXPECT_NEAR(findings[i].ratio, expected[i].second, kExact);
      EXPECT_NEAR(findings[i].edge_m, kEdge_m / expected[i].second, 1e-12);
    }
  }
  /// The filter follows the tags.
  void print_all(double ratio) {
    printed_ = {{0, ratio}, {1, ratio}, {2, ratio}};
    filter_scale_ = 1 / ratio;
  }

  std::optional<SizeCheck> check_;  ///< Begins with the first run.
  BodySensors configured_;
  std::map<int, Pose> tags_;
  std::map<int, double> printed_;  ///< printed / configured
  std::optional<Pose> true_X_BV_;  ///< nullopt: as configured
  LensOffset true_lens_{};         ///< Against what is configured.
  double amplitude_{1};
  double late_s_{0};        ///< Delay of the images against their stamps.
  double filter_scale_{1};  ///< Of the positions in the filter.
  std::uint64_t allocated_{0};
};

TEST_F(SizeCheckTest, DoesNotReportRightSizes) {
  EXPECT_TRUE(run(60).empty());
  ASSERT_TRUE(check_->common());
  EXPECT_NEAR(check_->common()->value, 0, kExact);
  EXPECT_NEAR(check_->of_tag(1, true)->value, 0, kExact);
  EXPECT_NEAR(check_->of_tag(1, false)->value, 0, kExact);
}

TEST_F(SizeCheckTest, ReportsOnceThatAllSizesAreWrong) {
  for (const double ratio : {0.8, 0.9, 1.1, 1.25}) {
    print_all(ratio);
    check_.reset();
    const auto findings = run(40);
    ASSERT_EQ(findings.size(), 1u) << ratio;
    EXPECT_FALSE(findings.front().tag_id);
    EXPECT_NEAR(findings.front().ratio, ratio, kExact * ratio);
  }
}

TEST_F(SizeCheckTest, ReportsEveryTagWithWrongSizeWorstFirst) {
  tags_[3] = {tags_[0].q, {0.5, -0.9, 4.2}};
  tags_[4] = {tags_[1].q, {-0.4, -0.5, 3.8}};
  printed_ = {{1, 1.1}, {3, 0.8}};
  expect_findings({{3, 0.8}, {1, 1.1}});
}

TEST_F(SizeCheckTest, ReportsATagWithoutImuByTheOtherTags) {
  configured_.imu.reset();
  printed_ = {{2, 0.9}};
  expect_findings({{2, 0.9}});
}

TEST_F(SizeCheckTest, DoesNotReportAllSizesWithoutImuOrMotion) {
  print_all(1.25);
  amplitude_ = 0.002;
  EXPECT_TRUE(run(40).empty());
  amplitude_ = 1;
  configured_.imu.reset();
  check_.reset();
  EXPECT_TRUE(run(40).empty());
}

TEST_F(SizeCheckTest, DoesNotReportTheErrorOfATapeMeasure) {
  printed_ = {{0, 1.03}, {1, 1.03}};
  EXPECT_TRUE(run(40).empty());
}

TEST_F(SizeCheckTest, IsRobustToWrongExtrinsics) {
  configured_.cameras.front().position_sigma_m = 0.05;
  configured_.cameras.front().rotation_sigma_rad = 0.05;
  true_X_BV_ =
      configured_.cameras.front().X_BV * Pose{exp_so3({0.04, -0.05, 0.03}), {0.04, -0.03, 0.05}};
  EXPECT_TRUE(run(40).empty());
  EXPECT_NEAR(check_->common()->value, 0, 2 * kExact);
}

TEST_F(SizeCheckTest, UsesTheLearnedLens) {
  true_lens_.k1 = -0.3;
  run(20);
  ASSERT_TRUE(check_->common());
  EXPECT_GT(std::abs(check_->common()->value), kExact) << "the tags are near the axis";
  check_.emplace(configured_, kCornerNoise_px);
  check_->set_lens(0, true_lens_);
  EXPECT_TRUE(run(20).empty());
  ASSERT_TRUE(check_->common());
  EXPECT_LT(std::abs(check_->common()->value), 0.1 * kExact);
}

TEST_F(SizeCheckTest, IsRobustToAClockError) {
  for (const double late_s : {-0.02, 0.02}) {
    late_s_ = late_s;
    check_.reset();
    EXPECT_TRUE(run(40).empty());
    EXPECT_NEAR(check_->common()->value, 0, 2 * kExact);
  }
}

TEST_F(SizeCheckTest, IsRobustToAMovedTag) {
  EXPECT_TRUE(run(21).empty());
  tags_[1].p += Eigen::Vector3d(0.2, 0.2, 0.1);
  EXPECT_TRUE(run(40, 21.05).empty());
}

TEST_F(SizeCheckTest, AllocatesNothingAfterTheFirstLooks) {
  run(5);
  allocated_ = 0;
  run(10, 5.05);
  EXPECT_EQ(allocated_, 0u);
}

class RejectionWatchTest : public testing::Test {
 protected:
  /// @return number of reports within the seconds, at 20 images a second
  int run(int seconds, int used, int rejected) {
    int reports = 0;
    for (int k = 0; k < 20 * seconds; ++k, ++image_) {
      UpdateReport report;
      report.exposed_at = instant_from_ns(50'000'000LL * image_);
      report.tags_used = used;
      report.tags_rejected = rejected;
      if (const auto share = watch_.add(report)) {
        ++reports;
        share_ = *share;
      }
    }
    return reports;
  }

  RejectionWatch watch_;
  long image_{20};
  double share_{0};
};

TEST_F(RejectionWatchTest, ReportsOnceThatHalfOfTheTagsContradictForTenSeconds) {
  EXPECT_EQ(run(9, 2, 2), 0);
  EXPECT_EQ(run(60, 2, 2), 1);
  EXPECT_DOUBLE_EQ(share_, 0.5);
  EXPECT_EQ(run(20, 4, 0), 0);
  EXPECT_EQ(run(20, 2, 2), 1) << "again after an improvement";
}

TEST_F(RejectionWatchTest, DoesNotReportOneTagInTenAFewBadSecondsOrNoTags) {
  EXPECT_EQ(run(60, 9, 1), 0);
  EXPECT_EQ(run(20, 4, 0), 0);
  EXPECT_EQ(run(4, 0, 4), 0);
  EXPECT_EQ(run(20, 4, 0), 0);
  watch_ = {};
  EXPECT_EQ(run(60, 0, 0), 0);
}

}  // namespace
}  // namespace fiducap
