#include "mapping/graph/graph_doubts.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

using Kind = FoundMismatch::Kind;

/// How well a number is known before any data, 1-sigma.
struct Priors {
  double tight{};    ///< While it is taken for right: exact, for all that the rest can tell.
  double open{};     ///< Once it is not.
  double settled{};  ///< It is as configured after all when it is known like this.
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
constexpr double kTold_sigma = 4.0;

double square(double x) { return x * x; }

double information_of(const DoubtedNumber& number) {
  const Priors priors = priors_of(number.kind);
  return 1 / square(number.doubt.is_open ? priors.open : priors.tight);
}

/// Of the data alone, in sigmas.
double score(const DoubtedNumber& number, double variance) {
  const double prior = information_of(number);
  const double of_data = 1 / variance - prior;
  constexpr double kRounding = 1e-8;
  if (!(of_data > kRounding * prior)) return 0;
  return number.value / (variance * std::sqrt(of_data));
}

Doubt& doubt_of(const DoubtedNumber& number, GraphState& graph) {
  if (number.camera >= 0) return graph.bodies[number.body].doubts.at(number.row);
  return number.kind == Kind::kAllPrints ? graph.prints : graph.tags[number.tag].print;
}

bool is_of_lens(Kind kind) { return kind != Kind::kReadout; }

bool opens_with(const DoubtedNumber& one, const DoubtedNumber& other) {
  if (one.variable == other.variable && one.row == other.row) return true;
  return one.camera >= 0 && one.camera == other.camera && one.body == other.body &&
         is_of_lens(one.kind) && is_of_lens(other.kind);
}

void add_camera(const GraphBody& body, std::size_t number, int row, int variable,
                std::vector<DoubtedNumber>& out) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const int camera = row / kCameraSize;
  const CameraBelief& now = body.cameras[static_cast<std::size_t>(camera)];
  DoubtedNumber one{.body = number, .camera = camera, .variable = variable, .row = row};
  one.doubt = body.doubts.at(row);
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
  out.push_back(one);
}

/// It has been moved since, or is another print by now.
bool is_of_before(const GraphState& graph, const GraphTag& tag) {
  return std::any_of(graph.tags.begin(), graph.tags.end(), [&](const GraphTag& other) {
    return other.tag_id == tag.tag_id && other.epoch > tag.epoch;
  });
}

}  // namespace

std::vector<DoubtedNumber> doubted_numbers(const GraphState& graph,
                                           const GraphVariables& variables) {
  std::vector<DoubtedNumber> out;
  for (std::size_t b = 0; b < graph.bodies.size(); ++b)
    for (const auto& [row, doubt] : graph.bodies[b].doubts)
      add_camera(graph.bodies[b], b, row, variables.body(b), out);
  out.push_back({.kind = Kind::kAllPrints,
                 .variable = variables.prints(),
                 .row = 0,
                 .value = graph.prints_scale,
                 .doubt = graph.prints});
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    out.push_back({.kind = Kind::kOnePrint,
                   .tag = i,
                   .variable = variables.tag(i),
                   .row = segment_layout::scale(0, 0) - segment_layout::tag(0, 0),
                   .value = graph.tags[i].scale,
                   .doubt = graph.tags[i].print});
  }
  return out;
}

double prior_information(const DoubtedNumber& number) {
  return information_of(number) - number.doubt.in_prior;
}

bool judge_doubts(const GraphCovariance& covariance, double dispersion, GraphState& graph) {
  const auto numbers = doubted_numbers(graph, covariance.variables());
  const double scale = std::sqrt(std::max(1.0, dispersion));
  const DoubtedNumber* worst = nullptr;
  double most = kOpen_sigma;
  bool is_changed = false;
  for (const DoubtedNumber& number : numbers) {
    const double variance = covariance.variance(number.variable, number.row);
    if (number.doubt.is_open) {
      const double sigma = std::sqrt(variance);
      // One at a time: what each alone may be, all together may not.
      if (is_changed || sigma > priors_of(number.kind).settled ||
          std::abs(number.value) > kClosed_sigma * sigma)
        continue;
      doubt_of(number, graph).is_open = false;
      is_changed = true;
      continue;
    }
    // Without IMU nothing says how large all of it is.
    if (number.camera < 0 && !graph.doubts) continue;
    const double beyond = std::abs(score(number, variance)) / scale;
    if (beyond < most) continue;
    worst = &number;
    most = beyond;
  }
  if (worst == nullptr) return is_changed;
  // Of what the worst one did, others are accused, too: one after the other.
  for (const DoubtedNumber& number : numbers)
    if (opens_with(*worst, number)) doubt_of(number, graph).is_open = true;
  return true;
}

std::vector<GraphFinding> findings_of(const GraphCovariance& covariance, const GraphState& graph) {
  std::vector<GraphFinding> out;
  for (const DoubtedNumber& number : doubted_numbers(graph, covariance.variables())) {
    const double sigma = std::sqrt(covariance.variance(number.variable, number.row));
    const double least = std::max(kTold_sigma * sigma, priors_of(number.kind).settled);
    if (!number.doubt.is_open || !(std::abs(number.value) > least)) continue;
    const bool is_print = number.kind == Kind::kOnePrint;
    if (is_print && is_of_before(graph, graph.tags[number.tag])) continue;
    out.push_back({number.camera < 0 ? -1 : graph.bodies[number.body].id,
                   {.kind = number.kind,
                    .camera = number.camera,
                    .tag_id = is_print ? graph.tags[number.tag].tag_id : -1,
                    .value = number.value,
                    .sigma = sigma}});
  }
  return out;
}

void fold_doubts(GraphState& graph) {
  for (const DoubtedNumber& number : doubted_numbers(graph, GraphVariables(graph)))
    if (number.camera >= 0) doubt_of(number, graph).in_prior = information_of(number);
}

}  // namespace fiducap
