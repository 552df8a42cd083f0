// The pose of the room in the workspace, the covariance after anchoring, and tags of the map that a
// filter holds.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>

#include "base/pose.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/update/world_filter.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/image_update.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"
#include "example_room.hpp"
#include "example_tags.hpp"
#include "support/jacobian_check.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

TEST(Gauge, DistancesBetweenTagsDoNotDependOnTheRoomPose) {
  const auto distance_variance = [](const FilterState& state) {
    const Eigen::Vector3d d = state.tags[1].X_WT.p - state.tags[0].X_WT.p;
    Eigen::RowVectorXd J = Eigen::RowVectorXd::Zero(state.size());
    J.segment<6>(state.tag_at(0)) =
        -d.normalized().transpose() * plain_from_world_error(state.tags[0].X_WT.p).topRows<3>();
    J.segment<6>(state.tag_at(1)) =
        d.normalized().transpose() * plain_from_world_error(state.tags[1].X_WT.p).topRows<3>();
    return propagated(J, state.P())(0, 0);
  };
  FilterState state = example_state();
  const double before = distance_variance(state);
  anchor_to_reference(state, 2, make_heading_rule({}, state.X_WB.q), true);
  EXPECT_NEAR(distance_variance(state), before, 1e-9 * before);
  anchor_to_known(state, 0, (state.X_WB * state.X_BV[0]).inverse() * state.tags[1].X_WT,
                  {exp_so3({0.1, 0.2, 2.0}), {5, 6, 7}}, true);
  EXPECT_NEAR(distance_variance(state), before, 1e-6 * before);
}

TEST(HeldTag, CorrectsTheBodyAndIsNotCorrected) {
  FilterState state = example_state();
  state.P() *= 1e-4;
  KnownTag known{77, 0.2, state.tags[0].X_WT, Matrix6d::Identity() * 1e-6};
  known.X_WT.p += Eigen::Vector3d(0.001, 0.002, -0.001);
  hold(state, known, Instant{});
  const std::size_t held = state.tags.size() - 1;
  const int at = state.tag_at(held);
  const Matrix6d own_before = state.P().block<6, 6>(at, at);
  const double body_before = state.P().topLeftCorner<6, 6>().trace();

  const CameraModel model = example_camera();
  const TagObservation seen = example_observation(
      77, 0.2, (state.X_WB * state.X_BV[0]).inverse() * state.tags[0].X_WT, model);
  const std::array<TagToUse, 1> use{TagToUse{&seen, static_cast<int>(held), nullptr}};
  std::vector<bool> accepted;
  CornerUpdate update;
  CornerNoise noise(EstimatorConfig{}, false);
  const UpdateReport report = update.apply(
      state, 0, model, use, {.gate = {chi_square_quantile(8, 0.999), 0}}, noise, accepted);
  EXPECT_EQ(report.tags_used, 1);
  EXPECT_LT((state.tags[held].X_WT.p - known.X_WT.p).norm(), 1e-15);
  EXPECT_LT((state.P().block<6, 6>(at, at) - own_before).norm(), 1e-12 * own_before.norm());
  EXPECT_LT((state.P().topLeftCorner<6, 6>().trace()), body_before);
  EXPECT_GT((state.P().block<6, 6>(at, 0)).norm(), 0.0) << "correlated with the map's error";
  EXPECT_GT(least_eigenvalue(state.P()), -1e-12);
}

TEST(ForgottenMotion, DoesNotChangeTagsBiasesAndExtrinsics) {
  FilterState state = example_state();
  FilterState before = state;
  camera_errors_to_extrinsics(before);
  forget_motion(state, Pose{exp_so3({0, 0, 1}), {1, 2, 3}}, true);
  camera_errors_to_extrinsics(state);
  const int rest = state.size() - layout::kBiasF;
  EXPECT_LT((state.P().bottomRightCorner(rest, rest) - before.P().bottomRightCorner(rest, rest))
                .cwiseAbs()
                .maxCoeff(),
            1e-9);
  EXPECT_TRUE((state.P().topRightCorner(layout::kBiasF, rest).isZero(1e-9)));
}

// While a body uses it, the map improves: each published pose is the old one with a smaller error.
// A filter that takes every version as independent is overconfident.
TEST(HeldMarginal, AnImprovingMapDoesNotMakeABodyOverconfident) {
  constexpr int kRuns = 12;
  double nees = 0;
  int count = 0;
  for (int run = 0; run < kRuns; ++run) {
    const auto seed = static_cast<std::uint64_t>(100 + run);
    ExampleRoom room({.seed = seed});
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss;
    std::map<int, Vector6d> error;
    double sigma = 0.02;
    for (const auto& [id, X] : room.tags)
      error[id] = sigma * Vector6d::NullaryExpr([&] { return gauss(random); });
    std::vector<KnownTag> map;
    const auto publish = [&] {
      map.clear();
      for (const auto& [id, X_RT] : room.tags) {
        KnownTag tag = room.known(id, X_RT, sigma);
        tag.X_WT.p -= error[id].head<3>();
        tag.X_WT.q = exp_so3(-error[id].tail<3>()) * X_RT.q;
        map.push_back(tag);
      }
    };
    publish();
    for (int i = 0; i < 240; ++i) {
      room.next_image({.tags = map, .may_define_workspace = false});
      if (i >= 20 && i % 4 == 0) {
        // As with one more measurement of everything: x̂ ← x̂ + K (y − x̂) per number.
        const double more = 4 * sigma;
        const double gain = sigma * sigma / (sigma * sigma + more * more);
        for (auto& [id, e] : error)
          e = (1 - gain) * e + gain * more * Vector6d::NullaryExpr([&] { return gauss(random); });
        sigma *= std::sqrt(1 - gain);
        publish();
      }
      if (i < 60 || i % 10 != 0) continue;
      nees += room.pose_nees();
      ++count;
    }
  }
  nees /= count;
  RecordProperty("nees_per_dof_percent", static_cast<int>(100 * nees));
  // 240 runs have 0.55. 12 runs, each pose largely of one draw of the map's errors: σ 0.1, four of
  // them.
  EXPECT_LT(nees, 0.95);
  EXPECT_GT(nees, 0.15);
}

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
    return filter_->update(seen, {.tags = known, .whole = &whole_without(own)});
  }
  /// @param own  not in the map
  const KnownMap& whole_without(int own) {
    std::vector<KnownTag> tags = map_;
    std::erase_if(tags, [&](const KnownTag& tag) { return tag.tag_id == own; });
    const auto same = [](const KnownTag& a, const KnownTag& b) {
      return a.tag_id == b.tag_id && a.X_WT.p == b.X_WT.p;
    };
    if (std::ranges::equal(tags, whole_.uncorrelated, same)) return whole_;
    whole_.uncorrelated = std::move(tags);
    ++whole_.revision;
    return whole_;
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
  KnownMap whole_;
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

TEST_F(HeldTags, TheMapTakesATagOfTheFilter) {
  constexpr int kOwn = 2;
  // No tag is given to the map while the clock is uncertain and the filter new.
  for (int i = 0; i < 150; ++i) show(0, kOwn);
  const std::vector<TagBelief> own = beliefs();
  ASSERT_EQ(own.size(), 1u);
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
  filter_->update(seen, {.tags = map_, .whole = &whole_without(-1)});
  for (int k = 0; k < 3; ++k) show(0);
  EXPECT_LT((tag(0).X_WT.p - before - shift).norm(), 1e-12);
}

}  // namespace
}  // namespace fiducap::world
