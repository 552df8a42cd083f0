#include "estimation/update/jump_search.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/pose.hpp"
#include "example_tags.hpp"

namespace fiducap {
namespace {

constexpr double kLength_s = 3.0;

/// A body that swings about one place without repetition.
Pose body_at(double t_s) {
  return {exp_so3(Eigen::Vector3d(0.3 * std::sin(2.1 * t_s), 0.4 * std::sin(1.7 * t_s + 1),
                                  0.2 * std::sin(2.9 * t_s))),
          Eigen::Vector3d(0.4 * std::sin(1.3 * t_s), 0.3 * std::cos(2.3 * t_s),
                          0.2 * std::sin(1.9 * t_s))};
}

/// Tags before the camera, seen by it at `t_s`.
struct Scene {
  CameraModel camera = example_camera();
  std::vector<TagObservation> seen;
  std::vector<SightedTag> sighted;

  void look(double t_s, int tags, const Eigen::Vector3d& first_moved = Eigen::Vector3d::Zero()) {
    seen.clear();
    sighted.clear();
    seen.reserve(static_cast<std::size_t>(tags));
    for (int k = 0; k < tags; ++k) {
      const Pose X_WT{exp_so3({3.0, 0, 0}), {0.3 * k, 0.1, 2.0}};
      Pose shown = X_WT;
      if (k == 0) shown.p += first_moved;
      seen.push_back(example_observation(k, 0.2, body_at(t_s).inverse() * shown, camera));
      sighted.push_back({&seen.back(), &camera, Pose{}, X_WT});
    }
  }
};

Instant at(double t_s) { return Instant{} + from_seconds(t_s); }

/// Images that were exposed `jump_s` after their stamps, for `images_s` at the end.
JumpSearch search_over(double jump_s, int tags, double images_s,
                       const Eigen::Vector3d& moved = Eigen::Vector3d::Zero()) {
  JumpSearch search;
  for (double t_s = 0; t_s <= kLength_s; t_s += 0.005) search.note_motion(at(t_s), body_at(t_s));
  Scene scene;
  for (double t_s = kLength_s - images_s; t_s <= kLength_s - 0.25; t_s += 0.05) {
    scene.look(t_s + jump_s, tags, moved);
    search.note_image(0, at(t_s), scene.sighted);
  }
  return search;
}

TEST(JumpSearch, FindsWhenImagesWereExposed) {
  for (const double jump_s : {-0.5, -0.2, -0.06, 0.06, 0.2}) {
    const auto found = search_over(jump_s, 2, 1.0).find(0, Duration{0});
    ASSERT_TRUE(found) << jump_s;
    EXPECT_NEAR(found->shift_s, jump_s, 0.01);
    EXPECT_TRUE(found->is_certain);
  }
}

TEST(JumpSearch, ReportsTheJumpRelativeToTheAppliedShift) {
  const auto found = search_over(0.3, 2, 1.0).find(0, from_seconds(0.1));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->shift_s, 0.2, 0.01);
}

TEST(JumpSearch, KeepsThreeSecondsOfFastReadings) {
  JumpSearch search;
  for (double t_s = 0; t_s <= kLength_s; t_s += 0.002) search.note_motion(at(t_s), body_at(t_s));
  Scene scene;
  for (double t_s = kLength_s - 2.5; t_s <= kLength_s - 1.5; t_s += 0.05) {
    scene.look(t_s - 0.1, 2, Eigen::Vector3d::Zero());
    search.note_image(0, at(t_s), scene.sighted);
  }
  EXPECT_TRUE(search.find(0, Duration{0}));
}

TEST(JumpSearch, FindsNothingWithoutAJumpOrABodyPose) {
  EXPECT_FALSE(search_over(0.0, 2, 1.0).find(0, Duration{0}));
  JumpSearch search = search_over(0.2, 2, 1.0);
  EXPECT_FALSE(search.find(1, Duration{0})) << "another camera";
  search.forget_all();
  EXPECT_FALSE(search.find(0, Duration{0}));
}

TEST(JumpSearch, OneTagIsEnoughAfterASwing) {
  const auto found = search_over(-0.2, 1, 1.2).find(0, Duration{0});
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->is_certain);
}

TEST(JumpSearch, AMovedTagIsNoJump) {
  for (const double images_s : {0.6, 0.8, 1.2}) {
    const auto found = search_over(0.0, 1, images_s, {0.2, -0.2, 0.1}).find(0, Duration{0});
    EXPECT_FALSE(found && found->is_certain) << images_s;
  }
}

}  // namespace
}  // namespace fiducap
