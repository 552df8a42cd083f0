// Information of a prior, its gradient, and the prior of cameras.
#include "mapping/graph/graph_prior.hpp"

#include <gtest/gtest.h>

#include <random>

#include <Eigen/LU>

#include "base/pose.hpp"
#include "estimation/segment/normal_equations.hpp"
#include "estimation/world/filter_state.hpp"
#include "mapping/graph/calibration_terms.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {
namespace {

constexpr int kTags = 4;
constexpr int kNumbers = 6 * kTags;
constexpr int kCamera = segment_layout::kCameraSize;

double cost_of(const GraphState& graph) {
  return normal_equations(graph, GraphVariables(graph)).cost;
}

Eigen::VectorXd draw(Eigen::Index size, std::mt19937_64& random) {
  std::normal_distribution<double> gauss;
  Eigen::VectorXd out(size);
  for (double& x : out) x = gauss(random);
  return out;
}

/// Tags in a row and one camera with a full joint covariance.
struct World {
  GraphState graph;
  Eigen::MatrixXd joint;  ///< Tags' plain numbers, then the camera's.

  explicit World(std::uint64_t seed, PriorUnknown unknown) {
    std::mt19937_64 random(seed);
    Eigen::MatrixXd root(kNumbers + kCamera, kNumbers + kCamera);
    for (auto column : root.colwise()) column = 3e-4 * draw(root.rows(), random);
    joint = root * root.transpose();
    graph.bodies.emplace_back();
    graph.bodies[0].cameras.emplace_back();
    graph.bodies[0].cameras[0].X_BV.p = {0.1, 0, 0};
    std::vector<PriorTag> tags;
    PriorCameras cameras;
    cameras.bodies.push_back(graph.bodies[0].cameras);
    cameras.covariance = joint.bottomRightCorner<kCamera, kCamera>();
    for (int i = 0; i < kTags; ++i) {
      const Pose X{exp_so3(draw(3, random)), Eigen::Vector3d(2.0 * i, 1, 0.3 * i)};
      graph.tags.push_back({.tag_id = i, .edge_m = 0.1, .X_WT = X});
      tags.push_back({static_cast<std::size_t>(i), X, joint.block<6, 6>(6 * i, 6 * i), false});
      cameras.of_tags.push_back(joint.block<6, kCamera>(6 * i, kNumbers));
    }
    graph.level[kInWorkspace] = true;
    const auto between = [&](std::size_t a, std::size_t b) -> std::optional<Matrix6d> {
      return Matrix6d(
          joint.block<6, 6>(static_cast<Eigen::Index>(6 * a), static_cast<Eigen::Index>(6 * b)));
    };
    graph.prior = make_prior(tags, between, cameras, unknown);
  }

  /// The world-side errors of H as plain ones.
  [[nodiscard]] Eigen::MatrixXd plain() const {
    // A tag has the scale of its print beside them, and all prints have one.
    const GraphVariables variables(graph);
    const BlockMatrix layout(variables.sizes());
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(kNumbers + kCamera, layout.rows());
    J.bottomLeftCorner<kCamera, kCamera>().setIdentity();  // the body's number comes first
    for (std::size_t i = 0; i < kTags; ++i)
      J.block<6, 6>(static_cast<Eigen::Index>(6 * i), layout.first(variables.tag(i))) =
          world::plain_from_world_error(graph.tags[i].X_WT.p);
    return J;
  }
};

Eigen::MatrixXd dense(const BlockMatrix& H) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(H.rows(), H.rows());
  for (int column = 0; column < H.variables(); ++column) {
    for (const auto& [row, block] : H.column(column)) {
      out.block(H.first(row), H.first(column), block.rows(), block.cols()) = block;
      out.block(H.first(column), H.first(row), block.cols(), block.rows()) = block.transpose();
    }
  }
  return out;
}

TEST(GraphPrior, IsTheJointCovarianceOfFewTagsAndCameras) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    const World world(seed, PriorUnknown::kNothing);
    const GraphVariables variables(world.graph);
    const auto equations = normal_equations(world.graph, variables);
    const Eigen::MatrixXd J = world.plain();
    const Eigen::MatrixXd P = J * dense(equations.H).inverse() * J.transpose();
    EXPECT_LT((P - world.joint).norm(), 1e-4 * world.joint.norm());
  }
}

TEST(GraphPrior, DoesNotFixPlaceAndYaw) {
  const World world(3, PriorUnknown::kPlaceAndYaw);
  GraphState moved = world.graph;
  const Pose T{exp_so3({0, 0, 0.001}), {0.002, 0.003, -0.001}};
  for (GraphTag& tag : moved.tags) tag.X_WT = T * tag.X_WT;
  GraphState one = world.graph;
  one.tags[1].X_WT = T * one.tags[1].X_WT;
  EXPECT_LT(cost_of(moved), 0.01 * cost_of(one));
  // … and is moved with the axes.
  GraphState turned = one;
  const Pose far{exp_so3({0, 0, 2.0}), {50, -20, 1}};
  for (GraphTag& tag : turned.tags) tag.X_WT = far * tag.X_WT;
  turned.prior.move(far);
  EXPECT_NEAR(cost_of(turned), cost_of(one), 1e-6 * cost_of(one));
}

TEST(GraphPrior, HasTheGradientOfItsCost) {
  constexpr double kStep = 1e-6;
  std::mt19937_64 random(9);
  World world(4, PriorUnknown::kPlaceAndYaw);
  GraphState& graph = world.graph;
  for (GraphTag& tag : graph.tags) {
    tag.X_WT.p += 0.002 * draw(3, random);
    tag.X_WT.q = exp_so3(0.002 * draw(3, random)) * tag.X_WT.q;
  }
  graph.bodies[0].cameras[0].lens.focal = 0.003;
  graph.bodies[0].cameras[0].shift_s = 0.001;
  const GraphVariables variables(graph);
  NormalEquations equations = normal_equations(graph, variables);
  // The gauge holds a tag and has no cost.
  for (Eigen::Index i = 0; i < equations.pull.size(); ++i) {
    const auto cost = [&](double step) {
      GraphState at = graph;
      move_by(step * Eigen::VectorXd::Unit(equations.pull.size(), i), variables, equations.H, at);
      return cost_of(at);
    };
    const double expected = -(cost(kStep) - cost(-kStep)) / (2 * kStep);
    EXPECT_NEAR(
        equations.pull(i), expected,
        2e-2 * std::abs(expected) + 1e-2 * equations.pull.norm() / std::sqrt(equations.pull.size()))
        << i;
  }
}

TEST(GraphPrior, FollowsRenumberedTags) {
  World world(5, PriorUnknown::kPlaceAndYaw);
  world.graph.tags[2].X_WT.p.x() += 0.01;
  const double before = cost_of(world.graph);
  std::swap(world.graph.tags[0], world.graph.tags[3]);
  world.graph.prior.renumber({3, 1, 2, 0});
  EXPECT_NEAR(cost_of(world.graph), before, 1e-9 * before);
}

/// A graph with a body whose filter has found its lens wrong.
GraphState with_found_lens(double configured_focal_sigma) {
  SegmentSensors sensors;
  sensors.cameras.resize(1);
  sensors.cameras[0].focal_sigma = configured_focal_sigma;
  GraphState graph;
  graph.bodies.push_back(body_by_configuration(1, std::make_shared<const SegmentSensors>(sensors)));
  MotionSegment segment;
  segment.cameras.resize(1);
  segment.cameras[0].lens_is_open = true;
  follow_filter(segment, 0, graph);
  return graph;
}

double focal_sigma(const GraphBody& body) {
  return 1 / std::sqrt(body.information(segment_layout::kFocal, segment_layout::kFocal));
}

TEST(GraphBody, KeepsTheConfiguredSigmaOfALensUnlessItWasExact) {
  EXPECT_NEAR(focal_sigma(with_found_lens(5e-4).bodies[0]), 5e-4, 1e-12);
  EXPECT_NEAR(focal_sigma(with_found_lens(0).bodies[0]), 0.05, 1e-9) << "it was wrong";
}

TEST(GraphBody, ClosesAParameterThatTheFilterHasClosed) {
  GraphState graph = with_found_lens(0);
  graph.prior.cameras = {graph.bodies[0].cameras};
  graph.prior.camera_information = graph.bodies[0].information;
  MotionSegment segment;
  segment.cameras.resize(1);
  follow_filter(segment, 0, graph);
  EXPECT_LT(focal_sigma(graph.bodies[0]), 1e-5);
  EXPECT_TRUE(graph.prior.camera_information.isApprox(graph.bodies[0].information)) << "folded";
}

TEST(GraphBody, OpensMountsSizesAndShuttersThatTheFilterHasFound) {
  using Kind = FoundMismatch::Kind;
  GraphState graph = with_found_lens(0);
  graph.tags.push_back({.tag_id = 3, .edge_m = 0.1});
  graph.tags.push_back({.tag_id = 4, .edge_m = 0.1});
  MotionSegment segment;
  segment.cameras.resize(1);
  segment.found = {{.kind = Kind::kMountRotation, .camera = 0},
                   {.kind = Kind::kReadout, .camera = 0},
                   {.kind = Kind::kAllPrints},
                   {.kind = Kind::kOnePrint, .tag_id = 4}};
  segment.imu.accel_scale.x() = 0.02;
  follow_filter(segment, 0, graph);
  const auto sigma = [&](int row) { return 1 / std::sqrt(graph.bodies[0].information(row, row)); };
  EXPECT_NEAR(sigma(0), 0.05, 1e-9);
  EXPECT_TRUE(graph.common_scale_is_open);
  EXPECT_FALSE(graph.tags[0].scale_is_open);
  EXPECT_TRUE(graph.tags[1].scale_is_open);
  EXPECT_EQ(graph.bodies[0].imu.accel_scale.x(), 0.02);
}

}  // namespace
}  // namespace fiducap
