#include "mapping/graph/calibration_terms.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace fiducap {

namespace {

using Kind = FoundMismatch::Kind;

// Relative sigmas of tag sizes: exact, or wrong, as in CalibrationMonitor.
constexpr double kTightSize = 1e-5;
constexpr double kOpenSize = 0.15;
constexpr double kReported_sigma = 4.0;
constexpr double kOpen_sigma = 5.0;

constexpr int kScaleRow = segment_layout::scale(0, 0) - segment_layout::tag(0, 0);

bool is_of_lens(Kind kind) {
  return kind == Kind::kFocalLength || kind == Kind::kCentreU || kind == Kind::kCentreV ||
         kind == Kind::kDistortion;
}

/// The tag has been moved since; another print may have its id now.
bool has_later_epoch(const GraphState& graph, const GraphTag& tag) {
  return std::ranges::any_of(graph.tags, [&](const GraphTag& other) {
    return other.tag_id == tag.tag_id && other.epoch > tag.epoch;
  });
}

// --- terms; each returns its cost ---

double add_body(const GraphBody& body, int variable, NormalEquations& out) {
  const Eigen::VectorXd error = error_between(body.expected, body.cameras);
  const Eigen::VectorXd pull = body.information * error;
  out.H.add(variable, variable, body.information);
  out.pull.segment(out.H.first(variable), error.size()) -= pull;
  return 0.5 * error.dot(pull);
}

/// A body and the same one before a jump of its clocks.
double add_same(const GraphState& graph, const GraphVariables& variables, std::size_t number,
                NormalEquations& out) {
  const GraphBody& body = graph.bodies[number];
  const auto before = static_cast<std::size_t>(body.same_as);
  const Eigen::VectorXd error = error_between(graph.bodies[before].cameras, body.cameras);
  const Eigen::VectorXd information =
      information_of_same().replicate(static_cast<Eigen::Index>(body.cameras.size()), 1);
  const Eigen::VectorXd pull = information.cwiseProduct(error);
  const Eigen::MatrixXd H = information.asDiagonal();
  const int a = variables.body(before);
  const int b = variables.body(number);
  out.H.add(a, a, H);
  out.H.add(b, b, H);
  out.H.add(b, a, -H);
  out.pull.segment(out.H.first(a), error.size()) += pull;
  out.pull.segment(out.H.first(b), error.size()) -= pull;
  return 0.5 * error.dot(pull);
}

/// The relative error of a tag size.
double add_size(double value, double sigma, int variable, int row, NormalEquations& out) {
  const double information = 1 / (sigma * sigma);
  const int size = out.H.size(variable);
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(size, size);
  own(row, row) = information;
  out.H.add(variable, variable, own);
  out.pull(out.H.first(variable) + row) -= information * value;
  return 0.5 * information * value * value;
}

double add_gravity(const GraphState& graph, int variable, NormalEquations& out) {
  constexpr double kExact_m_s2 = 1e-7;
  const double sigma = std::max(kExact_m_s2, graph.gravity_sigma_m_s2);
  const double pull = graph.gravity_offset_m_s2 / (sigma * sigma);
  out.H.add(variable, variable, Eigen::MatrixXd::Constant(1, 1, 1 / (sigma * sigma)));
  out.pull(out.H.first(variable)) -= pull;
  return 0.5 * graph.gravity_offset_m_s2 * pull;
}

}  // namespace

void add_sensor_terms(const GraphState& graph, const GraphVariables& variables,
                      NormalEquations& out) {
  double cost = add_gravity(graph, variables.gravity(), out);
  // Those of the first bodies are in the GraphPrior.
  for (std::size_t i = graph.prior.cameras.size(); i < graph.bodies.size(); ++i) {
    cost += add_body(graph.bodies[i], variables.body(i), out);
    if (graph.bodies[i].same_as >= 0) cost += add_same(graph, variables, i, out);
  }
  cost += add_size(graph.common_scale, graph.common_scale_is_open ? kOpenSize : kTightSize,
                   variables.common_scale(), 0, out);
  for (std::size_t i = 0; i < graph.tags.size(); ++i)
    cost += add_size(graph.tags[i].scale, graph.tags[i].scale_is_open ? kOpenSize : kTightSize,
                     variables.tag(i), kScaleRow, out);
  out.cost += cost;
}

/// The size of a single tag stays open: filters watch a few at a time.
void follow_filter(const MotionSegment& segment, std::size_t body, GraphState& graph) {
  OpenParameters open = graph.bodies[body].tested;
  for (std::size_t c = 0; c < segment.cameras.size(); ++c)
    if (segment.cameras[c].lens_is_open) open.insert({Kind::kLens, static_cast<int>(c)});
  for (const FoundMismatch& found : segment.found) {
    if (is_of_lens(found.kind)) open.insert({Kind::kLens, found.camera});
    if (found.kind == Kind::kMountPosition || found.kind == Kind::kMountRotation)
      open.insert({Kind::kMountPosition, found.camera});
    if (found.kind == Kind::kReadout || found.kind == Kind::kAllPrints)
      open.insert({found.kind, found.camera});
    for (GraphTag& tag : graph.tags)
      tag.scale_is_open |= found.kind == Kind::kOnePrint && tag.tag_id == found.tag_id;
  }
  GraphBody& own = graph.bodies[body];
  own.imu = segment.imu;
  for (std::size_t c = 0; c < own.cameras.size(); ++c)
    own.cameras[c].lens_is_open = open.contains({Kind::kLens, static_cast<int>(c)});
  if (open == own.open) return;
  open_parameters(open, body, graph);
  graph.common_scale_is_open = std::ranges::any_of(graph.bodies, [](const GraphBody& one) {
    return one.open.contains({Kind::kAllPrints, -1});
  });
}

bool test_parameters(const GraphCovariance& covariance, double dispersion, GraphState& graph) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const GraphVariables& variables = covariance.variables();
  double most = kOpen_sigma * std::sqrt(std::max(1.0, dispersion));
  std::function<void()> open;
  const auto test = [&](double value, double prior, int variable, int row, auto how) {
    const double variance = covariance.variance(variable, row);
    const double information = 1 / variance - prior;  // of the data
    constexpr double kRounding = 1e-8;
    if (!(information > kRounding * prior)) return;
    const double score = std::abs(value) / (variance * std::sqrt(information));
    if (score < most) return;
    most = score;
    open = how;
  };
  bool doubts = false;
  for (std::size_t b = 0; b < graph.bodies.size(); ++b) {
    GraphBody& body = graph.bodies[b];
    if (!body.sensors->doubts || body.same_as >= 0) continue;
    doubts = true;
    const Eigen::VectorXd off = error_between(body.expected, body.cameras);
    const auto test_group = [&](Kind kind, int camera, int first, int end) {
      if (body.open.contains({kind, camera})) return;
      for (int at = kCameraSize * camera + first; at < kCameraSize * camera + end; ++at)
        test(off(at), body.information(at, at), variables.body(b), at, [&graph, b, kind, camera] {
          graph.bodies[b].tested.insert({kind, camera});
          OpenParameters now = graph.bodies[b].open;
          now.insert({kind, camera});
          open_parameters(now, b, graph);
        });
    };
    for (std::size_t c = 0; c < body.cameras.size(); ++c) {
      const CameraMount& mount = body.sensors->cameras[c];
      const int camera = static_cast<int>(c);
      if (mount.readout_sigma_s == 0 && !body.expected[c].rows_apart)
        test_group(Kind::kReadout, camera, kReadout, kFocal);
      if (mount.focal_sigma == 0 && mount.centre_sigma_px == 0 && mount.k1_sigma == 0)
        test_group(Kind::kLens, camera, kFocal, kCameraSize);
    }
  }
  if (!doubts) return false;  // without IMU the scale of the whole is not observable
  const double tight = 1 / (kTightSize * kTightSize);
  if (!graph.common_scale_is_open)
    test(graph.common_scale, tight, variables.common_scale(), 0, [&graph] {
      graph.bodies.front().tested.insert({Kind::kAllPrints, -1});
      graph.bodies.front().open.insert({Kind::kAllPrints, -1});
      graph.common_scale_is_open = true;
    });
  for (std::size_t i = 0; i < graph.tags.size(); ++i)
    if (!graph.tags[i].scale_is_open)
      test(graph.tags[i].scale, tight, variables.tag(i), kScaleRow,
           [&graph, i] { graph.tags[i].scale_is_open = true; });
  if (!open) return false;
  open();
  return true;
}

std::vector<GraphFinding> findings_of(const GraphCovariance& covariance, const GraphState& graph) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  std::vector<GraphFinding> out;
  const GraphVariables& variables = covariance.variables();
  const auto add = [&](int body_id, FoundMismatch what, int variable, int row) {
    what.sigma = std::sqrt(covariance.variance(variable, row));
    if (std::abs(what.value) > kReported_sigma * what.sigma) out.push_back({body_id, what});
  };
  for (std::size_t b = 0; b < graph.bodies.size(); ++b) {
    const GraphBody& body = graph.bodies[b];
    if (body.same_as >= 0) continue;
    const Eigen::VectorXd off = error_between(body.expected, body.cameras);
    const auto add_row = [&](Kind kind, int camera, int row) {
      const int at = kCameraSize * camera + row;
      add(body.id, {.kind = kind, .camera = camera, .value = off(at)}, variables.body(b), at);
    };
    for (const auto& [kind, camera] : body.open) {
      if (kind == Kind::kReadout) add_row(kind, camera, kReadout);
      if (kind != Kind::kLens) continue;
      add_row(Kind::kFocalLength, camera, kFocal);
      add_row(Kind::kCentreU, camera, kCentre);
      add_row(Kind::kCentreV, camera, kCentre + 1);
      add_row(Kind::kDistortion, camera, kDistortion);
    }
  }
  if (graph.common_scale_is_open)
    add(-1, {.kind = Kind::kAllPrints, .value = graph.common_scale}, variables.common_scale(), 0);
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    const GraphTag& tag = graph.tags[i];
    if (tag.scale_is_open && !has_later_epoch(graph, tag))
      add(-1, {.kind = Kind::kOnePrint, .tag_id = tag.tag_id, .value = tag.scale}, variables.tag(i),
          kScaleRow);
  }
  return out;
}

}  // namespace fiducap
