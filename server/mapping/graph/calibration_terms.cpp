#include "mapping/graph/calibration_terms.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

using Kind = FoundMismatch::Kind;

constexpr double kOpenSize = 0.15;  // relative sigma of a wrong tag size, as in CalibrationMonitor
// A difference that noise exceeds in one of 16,000 cases.
constexpr double kReported_sigma = 4.0;

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

// --- terms ---

/// A body and the same one before a jump of its clocks.
void add_same(const GraphState& graph, const GraphVariables& variables, std::size_t number,
              NormalEquations& out) {
  const GraphBody& body = graph.bodies[number];
  const auto before = static_cast<std::size_t>(body.same_as);
  const Eigen::VectorXd error = error_between(graph.bodies[before].cameras, body.cameras);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(error.size(), error.size());
  const Eigen::VectorXd information =
      information_of_same().replicate(static_cast<Eigen::Index>(body.cameras.size()), 1);
  out.add_square({{variables.body(before), 0, -one}, {variables.body(number), 0, one}},
                 information.asDiagonal(), error);
}

/// A number that is exact, or wrong.
void add_number(double value, double sigma, int variable, int row, NormalEquations& out) {
  out.add_square({{variable, 0, Eigen::RowVectorXd::Unit(out.H.size(variable), row)}},
                 Eigen::MatrixXd::Constant(1, 1, 1 / (sigma * sigma)),
                 Eigen::VectorXd::Constant(1, value));
}

double sigma_of_size(bool is_open) { return is_open ? kOpenSize : kExactSigma; }

}  // namespace

void add_sensor_terms(const GraphState& graph, const GraphVariables& variables,
                      NormalEquations& out) {
  add_number(graph.gravity_offset_m_s2, std::max(kExactSigma, graph.gravity_sigma_m_s2),
             variables.gravity(), 0, out);
  // Those of the first bodies are in the GraphPrior.
  for (std::size_t i = graph.prior.cameras.size(); i < graph.bodies.size(); ++i) {
    const GraphBody& body = graph.bodies[i];
    const Eigen::VectorXd error = error_between(body.expected, body.cameras);
    out.add_square({{variables.body(i), 0, Eigen::MatrixXd::Identity(error.size(), error.size())}},
                   body.information, error);
    if (body.same_as >= 0) add_same(graph, variables, i, out);
  }
  add_number(graph.common_scale, sigma_of_size(graph.common_scale_is_open),
             variables.common_scale(), 0, out);
  for (std::size_t i = 0; i < graph.tags.size(); ++i)
    add_number(graph.tags[i].scale, sigma_of_size(graph.tags[i].scale_is_open), variables.tag(i),
               kScaleRow, out);
}

/// The size of a single tag stays open: filters watch a few at a time.
void follow_filter(const MotionSegment& segment, std::size_t body, GraphState& graph) {
  OpenParameters open;
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
