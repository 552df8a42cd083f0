#include <gtest/gtest.h>

#include "estimation/world/world_filter.hpp"
#include "example_tags.hpp"

namespace fiducap::world {
namespace {

constexpr int kMapTags = 60;
constexpr int kInView = 4;

/// A body at rest in a mapped room; images show different parts of it.
class HeldTags : public testing::Test {
 protected:
  HeldTags() {
    CameraMount mount;
    mount.model = example_camera();
    filter_ = std::make_unique<WorldFilter>(BodySensors{.cameras = {mount}, .imu = ImuNoise{}},
                                            WorkspaceGauge{}, EstimatorConfig{});
    for (int i = 0; i < kMapTags; ++i) {
      const Pose X_WT{exp_so3({2.6, 0.4, 0.3}),
                      {-0.7 + 0.14 * (i % 10), -0.5 + 0.2 * (i / 10), 2.0}};
      map_.push_back({i, 0.2, X_WT, Matrix6d::Identity() * 1e-6});
    }
  }

  /// @param own  a tag in view that the map does not have (yet)
  UpdateReport show(int first, int own = -1) {
    for (int i = 0; i < 10; ++i)
      filter_->propagate(
          {now_ += std::chrono::milliseconds(5), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
    TagObservations seen;
    seen.exposed_at = now_ - std::chrono::milliseconds(2);
    std::vector<KnownTag> known;
    for (int k = 0; k < kInView; ++k) {
      const KnownTag& tag = map_[static_cast<std::size_t>((first + k) % kMapTags)];
      if (tag.tag_id != own) known.push_back(tag);
      seen.tags.push_back(example_observation(tag.tag_id, tag.edge_m, tag.X_WT, example_camera()));
    }
    return filter_->update(seen, {known});
  }

  [[nodiscard]] std::vector<TagBelief> beliefs() const {
    std::vector<TagBelief> out;
    filter_->tag_beliefs(out);
    return out;
  }
  [[nodiscard]] const WorldTag& tag(int id) const {
    return filter_->state().tags[static_cast<std::size_t>(filter_->state().find(id))];
  }

  std::unique_ptr<WorldFilter> filter_;
  std::vector<KnownTag> map_;
  Instant now_{};
};

TEST_F(HeldTags, AreBoundedForAnySizeOfTheMap) {
  for (int i = 0; i < 60; ++i) show(0);
  ASSERT_TRUE(filter_->running());
  std::size_t most = 0;
  for (int i = 0; i < 300; ++i) {
    const UpdateReport report = show(i * kInView);
    EXPECT_EQ(report.tags_used, kInView) << "image " << i;
    most = std::max(most, filter_->state().tags.size());
  }
  EXPECT_LE(most, 20u);
  EXPECT_LT(filter_->estimate().X_WB.p.norm(), 1e-3);
  EXPECT_TRUE(beliefs().empty()) << "no own tags";
}

TEST_F(HeldTags, AnAdoptedTagReturnsAsATagOfTheMap) {
  constexpr int kOwn = 2;
  // No tag is given to the map while the clock is uncertain and the filter new.
  for (int i = 0; i < 150; ++i) show(0, kOwn);
  const std::vector<TagBelief> own = beliefs();
  ASSERT_EQ(own.size(), 1u);
  const auto variance = [&] { return filter_->estimate().covariance.diagonal().head<3>().sum(); };
  const double before = variance();
  filter_->release_tag(kOwn);
  EXPECT_LT(filter_->state().find(kOwn), 0);
  EXPECT_DOUBLE_EQ(variance(), before);
  map_[kOwn] = own.front().tag;
  EXPECT_EQ(show(0).tags_used, kInView);
  ASSERT_GE(filter_->state().find(kOwn), 0);
  EXPECT_TRUE(tag(kOwn).held);
}

TEST_F(HeldTags, FollowTheMapWhenItChanges) {
  for (int i = 0; i < 60; ++i) show(0);
  const Eigen::Vector3d shift(0.02, -0.01, 0.03);
  for (KnownTag& known : map_) known.X_WT.p += shift;
  const Eigen::Vector3d before = tag(0).X_WT.p;
  TagObservations seen;
  seen.exposed_at = now_ += std::chrono::milliseconds(1);
  filter_->update(seen, {map_});
  for (int k = 0; k < 3; ++k) show(0);
  EXPECT_LT((tag(0).X_WT.p - before - shift).norm(), 1e-12);
}

}  // namespace
}  // namespace fiducap::world
