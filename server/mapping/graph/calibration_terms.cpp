#include "mapping/graph/calibration_terms.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

using Kind = FoundMismatch::Kind;

/// Prior sigmas of a tested parameter.
struct Priors {
  double tight{};    ///< Closed: exact.
  double open{};     ///< Open.
  double settled{};  ///< Posterior sigma at which it may be closed again.
};

Priors priors_of(Kind kind) {
  switch (kind) {
    case Kind::kReadout:
      return {5e-6, 0.02, 3e-4};
    case Kind::kFocalLength:
      return {5e-6, 0.05, 1e-3};
    case Kind::kCentreU:
    case Kind::kCentreV:
      return {0.005, 20.0, 0.5};
    case Kind::kDistortion:
      return {2e-6, 0.1, 2e-3};
    case Kind::kAllPrints:
      return {1e-5, 0.05, 5e-4};
    default:
      return {1e-5, 0.1, 5e-4};
  }
}

constexpr double kOpen_sigma = 5.0;
constexpr double kClosed_sigma = 2.0;
constexpr double kReported_sigma = 4.0;

struct TestedParameter {
  Kind kind{};
  std::size_t body{};  ///< Index, of a camera's parameter …
  int camera{-1};      ///< … else -1.
  std::size_t tag{};   ///< Index, of the size of one tag.
  int variable{};      ///< Position in the equations …
  int row{};           ///< … and there.
  double value{};      ///< Against the configuration.
  TestedPrior prior{};
};

double square(double x) { return x * x; }

double information_of(const TestedParameter& one) {
  const Priors priors = priors_of(one.kind);
  return 1 / square(one.prior.is_open ? priors.open : priors.tight);
}

/// Of the data alone, in sigmas.
double score(const TestedParameter& one, double variance) {
  const double prior = information_of(one);
  const double of_data = 1 / variance - prior;
  constexpr double kRounding = 1e-8;
  if (!(of_data > kRounding * prior)) return 0;
  return one.value / (variance * std::sqrt(of_data));
}

TestedPrior& prior_of(const TestedParameter& one, GraphState& graph) {
  if (one.camera >= 0) return graph.bodies[one.body].tested.at(one.row);
  return one.kind == Kind::kAllPrints ? graph.common_scale_prior : graph.tags[one.tag].scale_prior;
}

bool opens_with(const TestedParameter& one, const TestedParameter& other) {
  if (one.variable == other.variable && one.row == other.row) return true;
  return one.camera >= 0 && one.camera == other.camera && one.body == other.body &&
         one.kind != Kind::kReadout && other.kind != Kind::kReadout;
}

TestedParameter camera_parameter(const GraphBody& body, std::size_t number, int row, int variable) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const int camera = row / kCameraSize;
  const CameraBelief& now = body.cameras[static_cast<std::size_t>(camera)];
  TestedParameter one{.body = number, .camera = camera, .variable = variable, .row = row};
  one.prior = body.tested.at(row);
  switch (row % kCameraSize) {
    case kReadout:
      one.kind = Kind::kReadout;
      one.value = now.readout_s - body.expected[static_cast<std::size_t>(camera)].readout_s;
      break;
    case kFocal:
      one.kind = Kind::kFocalLength;
      one.value = now.lens.focal;
      break;
    case kCentre:
      one.kind = Kind::kCentreU;
      one.value = now.lens.centre_px.x();
      break;
    case kCentre + 1:
      one.kind = Kind::kCentreV;
      one.value = now.lens.centre_px.y();
      break;
    default:
      one.kind = Kind::kDistortion;
      one.value = now.lens.k1;
  }
  return one;
}

std::vector<TestedParameter> tested_parameters(const GraphState& graph,
                                               const GraphVariables& variables) {
  std::vector<TestedParameter> out;
  for (std::size_t b = 0; b < graph.bodies.size(); ++b)
    for (const auto& [row, prior] : graph.bodies[b].tested)
      out.push_back(camera_parameter(graph.bodies[b], b, row, variables.body(b)));
  out.push_back({.kind = Kind::kAllPrints,
                 .variable = variables.common_scale(),
                 .row = 0,
                 .value = graph.common_scale,
                 .prior = graph.common_scale_prior});
  for (std::size_t i = 0; i < graph.tags.size(); ++i)
    out.push_back({.kind = Kind::kOnePrint,
                   .tag = i,
                   .variable = variables.tag(i),
                   .row = segment_layout::scale(0, 0) - segment_layout::tag(0, 0),
                   .value = graph.tags[i].scale,
                   .prior = graph.tags[i].scale_prior});
  return out;
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

double add_tested(const TestedParameter& one, NormalEquations& out) {
  const double information = information_of(one) - one.prior.folded;
  const int size = out.H.size(one.variable);
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(size, size);
  own(one.row, one.row) = information;
  out.H.add(one.variable, one.variable, own);
  out.pull(out.H.first(one.variable) + one.row) -= information * one.value;
  return 0.5 * information * one.value * one.value;
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
  for (const TestedParameter& one : tested_parameters(graph, variables))
    cost += add_tested(one, out);
  out.cost += cost;
}

bool test_parameters(const GraphCovariance& covariance, double dispersion, GraphState& graph) {
  const auto parameters = tested_parameters(graph, covariance.variables());
  const double scale = std::sqrt(std::max(1.0, dispersion));
  const TestedParameter* worst = nullptr;
  double most = kOpen_sigma;
  bool is_changed = false;
  for (const TestedParameter& one : parameters) {
    const double variance = covariance.variance(one.variable, one.row);
    if (one.prior.is_open) {
      const double sigma = std::sqrt(variance);
      // One at a time: all of them together may be significant.
      if (is_changed || sigma > priors_of(one.kind).settled ||
          std::abs(one.value) > kClosed_sigma * sigma)
        continue;
      prior_of(one, graph).is_open = false;
      is_changed = true;
      continue;
    }
    // Without IMU the scale of the whole is not observable.
    if (one.camera < 0 && !graph.tests_sizes) continue;
    const double beyond = std::abs(score(one, variance)) / scale;
    if (beyond < most) continue;
    worst = &one;
    most = beyond;
  }
  if (worst == nullptr) return is_changed;
  // An error of one parameter raises the scores of others: one after the other.
  for (const TestedParameter& one : parameters)
    if (opens_with(*worst, one)) prior_of(one, graph).is_open = true;
  return true;
}

std::vector<GraphFinding> findings_of(const GraphCovariance& covariance, const GraphState& graph) {
  std::vector<GraphFinding> out;
  for (const TestedParameter& one : tested_parameters(graph, covariance.variables())) {
    const double sigma = std::sqrt(covariance.variance(one.variable, one.row));
    const double least = std::max(kReported_sigma * sigma, priors_of(one.kind).settled);
    if (!one.prior.is_open || !(std::abs(one.value) > least)) continue;
    const GraphTag* tag = one.kind == Kind::kOnePrint ? &graph.tags[one.tag] : nullptr;
    if (tag != nullptr && has_later_epoch(graph, *tag)) continue;
    out.push_back({one.camera < 0 ? -1 : graph.bodies[one.body].id,
                   {.kind = one.kind,
                    .camera = one.camera,
                    .tag_id = tag != nullptr ? tag->tag_id : -1,
                    .value = one.value,
                    .sigma = sigma}});
  }
  return out;
}

void fold_tested_priors(GraphState& graph) {
  for (const TestedParameter& one : tested_parameters(graph, GraphVariables(graph)))
    if (one.camera >= 0) prior_of(one, graph).folded = information_of(one);
}

}  // namespace fiducap
