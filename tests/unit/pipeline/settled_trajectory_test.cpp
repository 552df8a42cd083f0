#include "pipeline/replay/settled_trajectory.hpp"

#include <gtest/gtest.h>

#include <random>

#include "base/so3.hpp"
#include "detection/corner_projection.hpp"
#include "support/bundle_nees.hpp"

namespace fiducap {
namespace {

constexpr double kNoise_px = 0.2;
// Standard deviations of chi-square: what an answer at the Cramér–Rao bound exceeds once in 10^5.
constexpr double kSigmas = 4.5;

/// Four tags on a wall (z = 0, faces along +z), a camera that passes in front of them.
class SettledTrajectoryTest : public ::testing::Test {
 protected:
  SettledTrajectoryTest() {
    CameraMount camera;
    camera.model = {800, 600, 500, 500, 400, 300, Distortion::kNone, {}};
    start_.cameras = {camera};
    for (int id = 0; id < 4; ++id) {
      const Pose X_WT{exp_so3({0.3 * (id % 2), 0.2 - 0.2 * id, 0}),
                      {0.6 * id - 0.9, 0.2 * (id % 2), 0}};
      true_tags_.push_back({id, 0.3, X_WT, Matrix6d::Zero()});
    }
    for (int i = 0; i < 40; ++i) {
      const double s = i / 20.0 - 1;
      // Camera axes: z towards the wall, y down.
      const Eigen::Quaterniond towards_wall(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
      true_poses_.push_back(
          {towards_wall * exp_so3({0.3 * s, -0.4 * s, 0.1}), {s, -0.3 * s, 2 + 0.2 * s}});
    }
    start_.known = {true_tags_[0]};
    for (int id = 1; id < 4; ++id) {
      start_.estimated.push_back(true_tags_[static_cast<std::size_t>(id)]);
      start_.estimated.back().X_WT.p += Eigen::Vector3d(0.03, -0.03, 0.03);
    }
  }

  [[nodiscard]] static Instant at(int i) {
    return instant_from_ns(1'000'000'000 + i * 100'000'000LL);
  }

  TagObservations seen_at(int i, const std::vector<int>& ids) {
    TagObservations seen;
    seen.exposed_at = at(i);
    for (const int id : ids) {
      const KnownTag& tag = true_tags_[static_cast<std::size_t>(id)];
      const Pose X_VT = true_poses_[static_cast<std::size_t>(i)].inverse() * tag.X_WT;
      TagObservation out;
      out.tag_id = id;
      out.edge_m = tag.edge_m;
      for (int k = 0; k < 4; ++k) {
        const Eigen::Vector2d noise(noise_(random_), noise_(random_));
        const auto corner = static_cast<std::size_t>(k);
        out.corners_px[corner] =
            start_.cameras[0].model.pinhole(X_VT * tag_corner(k, tag.edge_m)) + noise;
        out.ideal_from_raw[corner].setIdentity();
      }
      seen.tags.push_back(out);
    }
    return seen;
  }

  /// What the filter says after image i, and where it has the tags then.
  void add(int i, const std::vector<int>& ids, const std::optional<Pose>& X_WB) {
    std::vector<KnownTag> tags = start_.known;
    tags.insert(tags.end(), start_.estimated.begin(), start_.estimated.end());
    const TagObservations seen = seen_at(i, ids);
    evidence_.frames.push_back({true_poses_[static_cast<std::size_t>(i)], {seen}});
    settled_.add(seen, X_WB, tags);
  }

  /// Everything that was seen, as a bundle; for judging the answer.
  RefinementProblem evidence_;
  std::mt19937 random_{11};
  std::normal_distribution<double> noise_{0, kNoise_px};
  SettlingStart start_;
  std::vector<KnownTag> true_tags_;
  std::vector<Pose> true_poses_;
  SettledTrajectory settled_{kNoise_px};
};

TEST_F(SettledTrajectoryTest, RefinesTheMapAndPutsRightWhatTheFilterHadWrong) {
  for (int i = 0; i < 40; ++i) {
    Pose X_WB = true_poses_[static_cast<std::size_t>(i)];
    // Now and then on the wrong side of the wall's normal, as after a planar branch taken wrongly;
    // now and then nowhere.
    if (i % 8 == 3) X_WB = Pose{exp_so3({0, 0.9, 0}), Eigen::Vector3d(1.5, 0, -0.5)} * X_WB;
    const std::vector<int> ids =
        i == 12 || i == 27 ? std::vector<int>{2} : std::vector<int>{0, 1, 2, 3};
    add(i, ids, i % 8 == 5 ? std::nullopt : std::optional(X_WB));
  }
  const auto settlement = settled_.settle(start_);
  ASSERT_TRUE(settlement) << settlement.error().text();
  ASSERT_EQ(settlement->trajectory.size(), 40u);
  EXPECT_EQ(settlement->images, 40);
  ASSERT_EQ(settlement->tags.size(), 3u);
  std::vector<Pose> X_WB;
  for (int i = 0; i < 40; ++i) {
    ASSERT_EQ(settlement->trajectory[static_cast<std::size_t>(i)].at, at(i));
    X_WB.push_back(settlement->trajectory[static_cast<std::size_t>(i)].X_WB);
  }
  evidence_.cameras = start_.cameras;
  evidence_.corner_noise_px = kNoise_px;
  const BundleNees nees = bundle_nees(evidence_, true_tags_, true_poses_, settlement->tags, X_WB);
  EXPECT_LT(std::abs(nees.sigmas()), kSigmas) << nees.value << " of " << nees.numbers;
}

TEST_F(SettledTrajectoryTest, CamerasOfOneInstantGiveOnePose) {
  start_.cameras.push_back(start_.cameras[0]);
  for (int i = 0; i < 5; ++i) {
    const Pose& X_WB = true_poses_[static_cast<std::size_t>(i)];
    add(i, {0, 1}, X_WB);
    TagObservations other = seen_at(i, {2, 3});
    other.camera = 1;
    settled_.add(other, X_WB, start_.estimated);
  }
  const auto settlement = settled_.settle(start_);
  ASSERT_TRUE(settlement) << settlement.error().text();
  EXPECT_EQ(settlement->trajectory.size(), 5u);
  EXPECT_EQ(settlement->images, 10);
}

TEST_F(SettledTrajectoryTest, ImagesWithoutATagOfTheMapHaveNoPose) {
  add(0, {0, 1}, std::nullopt);
  add(1, {2}, std::nullopt);
  add(2, {}, std::nullopt);
  std::erase_if(start_.estimated, [](const KnownTag& tag) { return tag.tag_id == 2; });
  const auto settlement = settled_.settle(start_);
  ASSERT_TRUE(settlement) << settlement.error().text();
  ASSERT_EQ(settlement->trajectory.size(), 1u);
  EXPECT_EQ(settlement->trajectory[0].at, at(0));
}

TEST_F(SettledTrajectoryTest, NoImagesGiveTheMapAsItWas) {
  const auto settlement = settled_.settle(start_);
  ASSERT_TRUE(settlement) << settlement.error().text();
  EXPECT_TRUE(settlement->trajectory.empty());
  ASSERT_EQ(settlement->tags.size(), 3u);
  EXPECT_EQ(settlement->tags[0].X_WT.p, start_.estimated[0].X_WT.p);
}

}  // namespace
}  // namespace fiducap
