// Terms of a map graph about cameras and prints as such: what is configured, what is the same, what
// is doubted.
#include <algorithm>

#include "mapping/graph/graph_doubts.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {

namespace {

double add_body(const GraphBody& body, int variable, NormalEquations* out) {
  const Eigen::VectorXd error = error_between(body.expected, body.cameras);
  const Eigen::VectorXd pull = body.information * error;
  if (out != nullptr) {
    out->H.add(variable, variable, body.information);
    out->pull.segment(out->H.first(variable), error.size()) -= pull;
  }
  return 0.5 * error.dot(pull);
}

/// A body and what it was before its clocks have jumped.
double add_same(const GraphState& graph, const GraphVariables& variables, std::size_t number,
                NormalEquations* out) {
  const GraphBody& body = graph.bodies[number];
  const auto before = static_cast<std::size_t>(body.same_as);
  const Eigen::VectorXd error = error_between(graph.bodies[before].cameras, body.cameras);
  const Eigen::VectorXd information =
      information_of_same().replicate(static_cast<Eigen::Index>(body.cameras.size()), 1);
  const Eigen::VectorXd pull = information.cwiseProduct(error);
  if (out != nullptr) {
    const Eigen::MatrixXd H = information.asDiagonal();
    const int a = variables.body(before);
    const int b = variables.body(number);
    out->H.add(a, a, H);
    out->H.add(b, b, H);
    out->H.add(b, a, -H);
    out->pull.segment(out->H.first(a), error.size()) += pull;
    out->pull.segment(out->H.first(b), error.size()) -= pull;
  }
  return 0.5 * error.dot(pull);
}

double add_doubted(const DoubtedNumber& number, NormalEquations* out) {
  const double information = prior_information(number);
  if (out != nullptr) {
    const int size = out->H.size(number.variable);
    Eigen::MatrixXd own = Eigen::MatrixXd::Zero(size, size);
    own(number.row, number.row) = information;
    out->H.add(number.variable, number.variable, own);
    out->pull(out->H.first(number.variable) + number.row) -= information * number.value;
  }
  return 0.5 * information * number.value * number.value;
}

double add_gravity(const GraphState& graph, int variable, NormalEquations* out) {
  constexpr double kExact_m_s2 = 1e-7;
  const double sigma = std::max(kExact_m_s2, graph.gravity_sigma_m_s2);
  const double pull = graph.gravity_offset_m_s2 / (sigma * sigma);
  if (out != nullptr) {
    out->H.add(variable, variable, Eigen::MatrixXd::Constant(1, 1, 1 / (sigma * sigma)));
    out->pull(out->H.first(variable)) -= pull;
  }
  return 0.5 * graph.gravity_offset_m_s2 * pull;
}

}  // namespace

double sensor_terms(const GraphState& graph, const GraphVariables& variables,
                    NormalEquations* out) {
  double cost = add_gravity(graph, variables.gravity(), out);
  for (std::size_t i = 0; i < graph.bodies.size(); ++i) {
    const bool is_in_prior = i < graph.prior.cameras.size();
    if (is_in_prior) continue;
    cost += add_body(graph.bodies[i], variables.body(i), out);
    if (graph.bodies[i].same_as >= 0) cost += add_same(graph, variables, i, out);
  }
  for (const DoubtedNumber& number : doubted_numbers(graph, variables))
    cost += add_doubted(number, out);
  return cost;
}

}  // namespace fiducap
