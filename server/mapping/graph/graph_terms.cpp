#include "mapping/graph/graph_terms.hpp"

#include <limits>

#include "base/pose.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/world/filter_state.hpp"
#include "mapping/graph/calibration_terms.hpp"

namespace fiducap {

namespace {

using Matrix15d = Eigen::Matrix<double, 15, 15>;
using segment_layout::kTagSize;

// Prior sigmas of a body before any image: m/s, m/s², rad/s.
constexpr double kStartVelocity = 5.0;
constexpr double kStartBiasF = 0.5;
constexpr double kStartBiasW = 0.05;
constexpr double kOdometryUp = 0.005;  // of a phone or a robot that feels gravity
constexpr double kStartRate = 5.0;     // without IMU the rate is stored as gyro bias
// Information that holds one tag of a component with a free gauge. The result does not depend on
// the number; with a weak one the whole would drift by non-linearity.
constexpr double kGauge = 1e11;

Matrix15d on_body(const Vector15d& error, const Pose& G_inverse) {
  const Matrix6d Ad = world::adjoint(G_inverse);
  const Eigen::Matrix3d R = G_inverse.rotation();
  Matrix15d J = Matrix15d::Identity();
  const Vector6d pose = error.head<6>();
  J.topLeftCorner<6, 6>() = inverse_left_jacobian(pose) * Ad;
  Vector6d velocity;
  velocity << error.segment<3>(6), error.segment<3>(3);
  const Matrix6d left = inverse_left_jacobian(velocity);
  J.block<3, 3>(6, 6) = left.topLeftCorner<3, 3>() * R;
  J.block<3, 3>(6, 3) = left.topRightCorner<3, 3>() * R;
  return J;
}

Pose axes_of(const GraphState& graph, const GraphSegment& segment) {
  return axes_between(segment.factor.begin.X_WB, graph.nodes[segment.begin].at.X_WB,
                      segment.raw.has_imu());
}

std::vector<TermPart> parts_of(const GraphState& graph, const GraphVariables& variables,
                               const GraphSegment& segment, const Pose& G_inverse,
                               const Eigen::VectorXd& error) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const int cameras = static_cast<int>(segment.factor.cameras.size());
  std::vector<TermPart> parts;
  parts.push_back(
      {variables.node(segment.begin), kBegin, on_body(error.segment<15>(kBegin), G_inverse)});
  parts.push_back({variables.node(segment.end), kEnd, on_body(error.segment<15>(kEnd), G_inverse)});
  Eigen::MatrixXd J = Eigen::MatrixXd::Identity(kCameraSize * cameras, kCameraSize * cameras);
  for (int c = 0; c < cameras; ++c)
    J.block<6, 6>(kCameraSize * c, kCameraSize * c) =
        inverse_left_jacobian(Vector6d(error.segment<6>(camera(c))));
  const auto body = static_cast<std::size_t>(graph.nodes[segment.begin].body);
  parts.push_back({variables.body(body), camera(0), std::move(J)});
  const Matrix6d Ad = world::adjoint(G_inverse);
  const auto tags = static_cast<int>(segment.tags.size());
  Eigen::MatrixXd by_common_scale = Eigen::MatrixXd::Zero(kTagSize * tags, 1);
  for (int i = 0; i < tags; ++i) {
    const int at = tag(cameras, i);
    J = Eigen::MatrixXd::Identity(kTagSize, kTagSize);
    J.topLeftCorner<6, 6>() = inverse_left_jacobian(Vector6d(error.segment<6>(at))) * Ad;
    parts.push_back({variables.tag(segment.tags[static_cast<std::size_t>(i)]), at, J});
    by_common_scale(scale(cameras, i) - tag(cameras, 0)) = 1;
  }
  if (tags > 0)
    parts.push_back({variables.common_scale(), tag(cameras, 0), std::move(by_common_scale)});
  if (segment.raw.has_imu())
    parts.push_back({variables.gravity(), gravity(cameras, tags), Eigen::MatrixXd::Identity(1, 1)});
  return parts;
}

void add_segment(const GraphState& graph, const GraphVariables& variables,
                 const GraphSegment& segment, NormalEquations& out) {
  const SegmentFactor& f = segment.factor;
  const Eigen::VectorXd error = error_of(graph, segment);
  const Eigen::VectorXd gradient = f.H * error + f.g;
  out.cost += cost_of(f, error);
  out.add(parts_of(graph, variables, segment, axes_of(graph, segment).inverse(), error), f.H,
          gradient);
}

/// Prior of velocity and biases where a chain begins, and of the tilt where odometry measures it.
void add_start(const GraphState& graph, const GraphVariables& variables, const ChainStart& start,
               NormalEquations& out) {
  using namespace world::layout;  // NOLINT: the block names are the subject
  const BodyMoment& now = graph.nodes[start.node].at;
  Vector15d error = Vector15d::Zero();
  Vector15d variance = Vector15d::Constant(std::numeric_limits<double>::infinity());
  std::vector<TermPart> parts{{variables.node(start.node), 0, Matrix15d::Identity()}};
  error.segment<3>(kVelocity) = now.v_WB;
  variance.segment<3>(kVelocity).setConstant(kStartVelocity * kStartVelocity);
  if (start.up_B) {
    const Eigen::Vector3d up_W = now.X_WB.q * *start.up_B;
    error.segment<2>(kAttitude) = Eigen::Vector3d::UnitZ().cross(up_W).head<2>();
    variance.segment<2>(kAttitude).setConstant(kOdometryUp * kOdometryUp);
  }
  error.segment<3>(kBiasF) = now.bias_f;
  error.segment<3>(kBiasW) = now.bias_w;
  const double rate = start.has_imu ? kStartBiasW : kStartRate;
  variance.segment<3>(kBiasF).setConstant(kStartBiasF * kStartBiasF);
  variance.segment<3>(kBiasW).setConstant(rate * rate);
  if (start.after >= 0) {
    const auto after = static_cast<std::size_t>(start.after);
    const BodyMoment& before = graph.nodes[after].at;
    constexpr double kLeast_s = 0.1;
    const double dt = std::max(kLeast_s, to_seconds(now.at - before.at));
    error.segment<3>(kBiasF) -= before.bias_f;
    error.segment<3>(kBiasW) -= before.bias_w;
    variance.segment<3>(kBiasF).setConstant(start.accel_walk * start.accel_walk * dt);
    variance.segment<3>(kBiasW).setConstant(start.gyro_walk * start.gyro_walk * dt);
    Matrix15d of_biases = Matrix15d::Zero();
    of_biases.bottomRightCorner<6, 6>().diagonal().setConstant(-1);
    parts.push_back({variables.node(after), 0, of_biases});
  }
  out.add_square(parts, variance.cwiseInverse().asDiagonal(), error);
}

Vector6d plain_error(const Pose& expected, const Pose& now) {
  Vector6d out;
  out << now.p - expected.p, log_so3(now.q * expected.q.conjugate());
  return out;
}

/// Of all cameras in the prior.
Eigen::VectorXd camera_error(const GraphState& graph) {
  Eigen::VectorXd out(graph.prior.camera_information.rows());
  Eigen::Index at = 0;
  for (std::size_t b = 0; b < graph.prior.cameras.size(); ++b) {
    const Eigen::VectorXd own = error_between(graph.prior.cameras[b], graph.bodies[b].cameras);
    out.segment(at, own.size()) = own;
    at += own.size();
  }
  return out;
}

Vector6d rest_of(const GraphState& graph, const GraphPrior::Conditional& conditional,
                 const Eigen::VectorXd& of_cameras) {
  const GraphPrior& prior = graph.prior;
  const auto error = [&](std::size_t i) {
    return plain_error(prior.expected[i], graph.tags[prior.tags[i]].X_WT);
  };
  Vector6d out = error(conditional.tag);
  for (std::size_t k = 0; k < conditional.given.size(); ++k)
    out -=
        conditional.A.middleCols<6>(static_cast<Eigen::Index>(6 * k)) * error(conditional.given[k]);
  if (conditional.C.cols() > 0) out -= conditional.C * of_cameras;
  return out;
}

void add_conditional(const GraphState& graph, const GraphVariables& variables,
                     const GraphPrior::Conditional& conditional, const Eigen::VectorXd& of_cameras,
                     NormalEquations& out) {
  const GraphPrior& prior = graph.prior;
  std::vector<TermPart> parts;
  const auto add_tag = [&](std::size_t i, const Eigen::MatrixXd& A) {
    const std::size_t tag = prior.tags[i];
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, kTagSize);
    J.leftCols<6>() = A * world::plain_from_world_error(graph.tags[tag].X_WT.p);
    parts.push_back({variables.tag(tag), 0, std::move(J)});
  };
  add_tag(conditional.tag, Matrix6d::Identity());
  for (std::size_t k = 0; k < conditional.given.size(); ++k)
    add_tag(conditional.given[k], -conditional.A.middleCols<6>(static_cast<Eigen::Index>(6 * k)));
  Eigen::Index at = 0;
  for (std::size_t b = 0; at < conditional.C.cols(); ++b) {
    const int size = out.H.size(variables.body(b));
    parts.push_back({variables.body(b), 0, -conditional.C.middleCols(at, size)});
    at += size;
  }
  out.add_square(parts, conditional.information, rest_of(graph, conditional, of_cameras));
}

void add_prior(const GraphState& graph, const GraphVariables& variables, NormalEquations& out) {
  const GraphPrior& prior = graph.prior;
  const Eigen::VectorXd cameras = camera_error(graph);
  std::vector<TermPart> parts;
  int at = 0;
  for (std::size_t b = 0; b < prior.cameras.size(); ++b) {
    const int rows = out.H.size(variables.body(b));
    parts.push_back({variables.body(b), at, Eigen::MatrixXd::Identity(rows, rows)});
    at += rows;
  }
  out.add_square(parts, prior.camera_information, cameras);
  for (const GraphPrior::Conditional& conditional : prior.conditionals)
    add_conditional(graph, variables, conditional, cameras, out);
}

/// Holds the tag seen most often of each component with a free gauge.
void add_gauges(const GraphState& graph, const GraphVariables& variables, NormalEquations& out) {
  std::map<int, std::size_t> held;
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    const auto [at, is_new] = held.try_emplace(graph.tags[i].component, i);
    if (graph.tags[i].sightings > graph.tags[at->second].sightings) at->second = i;
  }
  for (const auto& [component, i] : held) {
    if (component == kInWorkspace && graph.prior.is_absolute) continue;
    Eigen::MatrixXd gauge = Eigen::MatrixXd::Zero(kTagSize, kTagSize);
    gauge.diagonal().head<3>().setConstant(kGauge);
    gauge(5, 5) = kGauge;
    if (!graph.level.at(component)) gauge.diagonal().segment<2>(3).setConstant(kGauge);
    out.H.add(variables.tag(i), variables.tag(i), gauge);
  }
}

}  // namespace

GraphVariables::GraphVariables(const GraphState& graph)
    : nodes_(graph.nodes.size()), bodies_(graph.bodies.size()) {
  sizes_.assign(nodes_, 15);
  for (const GraphBody& body : graph.bodies)
    sizes_.push_back(segment_layout::kCameraSize * static_cast<int>(body.cameras.size()));
  sizes_.insert(sizes_.end(), {1, 1});  // common scale, gravity
  sizes_.insert(sizes_.end(), graph.tags.size(), segment_layout::kTagSize);
}

Eigen::VectorXd error_between(const std::vector<CameraBelief>& from,
                              const std::vector<CameraBelief>& to) {
  constexpr int kSize = segment_layout::kCameraSize;
  Eigen::VectorXd error(kSize * static_cast<int>(from.size()));
  for (std::size_t c = 0; c < from.size(); ++c) {
    const CameraBelief& a = from[c];
    const CameraBelief& b = to[c];
    auto own = error.segment<kSize>(kSize * static_cast<int>(c));
    own.head<6>() = world::world_error_between(a.X_BV, b.X_BV);
    own.tail<6>() << b.shift_s - a.shift_s, b.readout_s - a.readout_s, b.lens.focal - a.lens.focal,
        b.lens.centre_px - a.lens.centre_px, b.lens.k1 - a.lens.k1;
  }
  return error;
}

Eigen::VectorXd error_of(const GraphState& graph, const GraphSegment& segment) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const SegmentFactor& f = segment.factor;
  const int cameras = static_cast<int>(f.cameras.size());
  const Pose G_inverse = axes_of(graph, segment).inverse();
  const GraphNode& begin = graph.nodes[segment.begin];
  const GraphNode& end = graph.nodes[segment.end];
  Eigen::VectorXd error(f.H.rows());
  error.segment<15>(kBegin) = error_between(f.begin, in_other_axes(G_inverse, begin.at));
  error.segment<15>(kEnd) = error_between(f.end, in_other_axes(G_inverse, end.at));
  error.segment(camera(0), kCameraSize * cameras) =
      error_between(f.cameras, graph.bodies[static_cast<std::size_t>(begin.body)].cameras);
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    const GraphTag& now = graph.tags[segment.tags[i]];
    const auto number = static_cast<int>(i);
    error.segment<6>(tag(cameras, number)) =
        world::world_error_between(f.tags[i].X_WT, G_inverse * now.X_WT);
    error(scale(cameras, number)) = graph.common_scale + now.scale - f.scales[i];
  }
  if (segment.raw.has_imu())
    error(gravity(cameras, static_cast<int>(segment.tags.size()))) =
        graph.gravity_offset_m_s2 - f.gravity_offset_m_s2;
  return error;
}

double cost_of(const SegmentFactor& factor, const Eigen::VectorXd& error) {
  return factor.cost + error.dot(factor.g + 0.5 * (factor.H * error));
}

NormalEquations normal_equations(const GraphState& graph, const GraphVariables& variables,
                                 std::optional<int> only) {
  NormalEquations out(variables.sizes());
  const auto is_in = [&](std::size_t node) {
    return !only || graph.nodes[node].component == *only;
  };
  for (const GraphSegment& segment : graph.segments)
    if (is_in(segment.begin)) add_segment(graph, variables, segment, out);
  for (ChainStart start : graph.starts) {
    if (start.after >= 0 && !is_in(static_cast<std::size_t>(start.after))) start.after = -1;
    if (is_in(start.node)) add_start(graph, variables, start, out);
  }
  add_sensor_terms(graph, variables, out);
  add_prior(graph, variables, out);
  add_gauges(graph, variables, out);
  // What does not count is held.
  const auto hold = [&](int variable) {
    const int size = out.H.size(variable);
    out.H.add(variable, variable, kGauge * Eigen::MatrixXd::Identity(size, size));
  };
  for (std::size_t i = 0; i < graph.nodes.size(); ++i)
    if (!is_in(i)) hold(variables.node(i));
  for (std::size_t i = 0; i < graph.tags.size(); ++i)
    if (only && graph.tags[i].component != *only) hold(variables.tag(i));
  return out;
}

void move_by(const Eigen::VectorXd& delta, const GraphVariables& variables, const BlockMatrix& H,
             GraphState& graph) {
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    BodyMoment& at = graph.nodes[i].at;
    at = moved(at, Vector15d(delta.segment<15>(H.first(variables.node(i)))));
  }
  for (std::size_t i = 0; i < graph.bodies.size(); ++i) {
    int at = H.first(variables.body(i));
    for (CameraBelief& camera : graph.bodies[i].cameras) {
      camera.X_BV = world::moved(camera.X_BV, delta.segment<6>(at));
      camera.shift_s += delta(at + 6);
      camera.readout_s += delta(at + 7);
      camera.lens.focal += delta(at + 8);
      camera.lens.centre_px += delta.segment<2>(at + 9);
      camera.lens.k1 += delta(at + 11);
      at += segment_layout::kCameraSize;
    }
  }
  graph.common_scale += delta(H.first(variables.common_scale()));
  graph.gravity_offset_m_s2 += delta(H.first(variables.gravity()));
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    GraphTag& tag = graph.tags[i];
    const int at = H.first(variables.tag(i));
    tag.X_WT = world::moved(tag.X_WT, delta.segment<6>(at));
    tag.scale += delta(at + 6);
  }
}

}  // namespace fiducap
