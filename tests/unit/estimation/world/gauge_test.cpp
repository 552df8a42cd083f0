// The pose of the room in the workspace, and the covariance after anchoring.
#include <gtest/gtest.h>

#include <array>

#include "base/pose.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/corner_update.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"
#include "support/jacobian_check.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

TEST(Gauge, TheReferenceTagIsAtItsDefinedPose) {
  FilterState state = example_state();
  const double up_before = (state.X_WB.q.conjugate() * Eigen::Vector3d::UnitZ()).z();
  WorkspaceGauge gauge;
  gauge.X_WT = Pose{exp_so3({1.2, 0.1, -0.4}), {3, -2, 1}};
  const HeadingRule rule = make_heading_rule(gauge, state.X_WB.q);
  const Pose before = state.X_WB;
  const Pose shift = anchor_to_reference(state, 2, rule, true);
  const KnownTag tag = tag_in_workspace(state, 2);
  EXPECT_LT((tag.X_WT.p - gauge.X_WT->p).norm(), 1e-9);
  EXPECT_LT(log_so3(turn_to_heading(rule, tag.X_WT.q)).norm(), 1e-9);
  EXPECT_NEAR((state.X_WB.q.conjugate() * Eigen::Vector3d::UnitZ()).z(), up_before, 1e-9)
      << "up must stay up";
  EXPECT_LT(tag.covariance.topLeftCorner(3, 3).cwiseAbs().maxCoeff(), 1e-9)
      << "exact by definition";
  EXPECT_LT(slack_of_reference(state, 2, rule, true).moved, 1e-9);
  EXPECT_LT(slack_of_reference(state, 2, rule, true).sigma, 1e-6);
  EXPECT_LT(((shift * before).p - state.X_WB.p).norm(), 1e-9);
}

TEST(Gauge, AnchoringAgainChangesNothing) {
  FilterState state = example_state();
  const HeadingRule rule = make_heading_rule({}, state.X_WB.q);
  anchor_to_reference(state, 0, rule, true);
  const FilterState once = state;
  anchor_to_reference(state, 0, rule, true);
  EXPECT_LT(once.error_to(state).norm(), 1e-9);
  EXPECT_LT((once.P() - state.P()).cwiseAbs().maxCoeff(), 1e-9);
}

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
  CornerUpdate<FilterState> update;
  CornerNoise noise(EstimatorConfig{}, false);
  const UpdateReport report =
      update.apply(state, 0, model, use, {.gate = chi_square_quantile(8, 0.999)}, noise, accepted);
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

}  // namespace
}  // namespace fiducap::world
