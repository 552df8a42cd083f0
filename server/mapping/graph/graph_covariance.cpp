#include "mapping/graph/graph_covariance.hpp"

#include <algorithm>

#include "estimation/world/filter_state.hpp"

namespace fiducap {

namespace {

constexpr double kDamping = 1e-12;

}  // namespace

std::set<std::pair<std::size_t, std::size_t>> bound_tags(const GraphState& graph) {
  std::set<std::pair<std::size_t, std::size_t>> out;
  const auto bind = [&](std::size_t a, std::size_t b) {
    if (a != b) out.emplace(std::min(a, b), std::max(a, b));
  };
  std::map<std::size_t, const GraphSegment*> ends;  // by the node where they end
  for (const GraphSegment& segment : graph.segments) ends[segment.end] = &segment;
  for (const GraphSegment& segment : graph.segments) {
    for (const std::size_t a : segment.tags)
      for (const std::size_t b : segment.tags) bind(a, b);
    const auto before = ends.find(segment.begin);
    if (before == ends.end()) continue;
    for (const std::size_t a : segment.tags)
      for (const std::size_t b : before->second->tags) bind(a, b);
  }
  const std::vector<std::size_t>& tags = graph.prior.tags;
  for (const GraphPrior::Hanging& hanging : graph.prior.hangings) {
    for (const std::size_t a : hanging.on) {
      bind(tags[hanging.tag], tags[a]);
      for (const std::size_t b : hanging.on) bind(tags[a], tags[b]);
    }
  }
  return out;
}

GraphCovariance::GraphCovariance(const GraphState& graph, GraphVariables variables, BlockMatrix H,
                                 BlockCholesky factor)
    : graph_(graph),
      variables_(std::move(variables)),
      H_(std::move(H)),
      factor_(std::move(factor)) {}

std::optional<GraphCovariance> GraphCovariance::of(const GraphState& graph) {
  const GraphVariables variables(graph);
  NormalEquations equations = normal_equations(graph, variables);
  auto factor = BlockCholesky::factor(equations.H, kDamping);
  if (!factor) return std::nullopt;
  factor->invert();
  return GraphCovariance(graph, variables, std::move(equations.H), std::move(*factor));
}

void GraphCovariance::refer_to(const std::vector<std::size_t>& tags) {
  std::vector<Datum::Tag> defining;
  std::vector<Pose> poses;
  for (const std::size_t i : tags) {
    defining.push_back({variables_.tag(i), graph_.tags[i].X_WT.p});
    poses.push_back(graph_.tags[i].X_WT);
  }
  datum_.emplace(defining, poses, factor_, H_);
}

std::optional<Matrix6d> GraphCovariance::between(std::size_t first, std::size_t second) const {
  const int a = variables_.tag(first);
  const int b = variables_.tag(second);
  const auto raw = factor_.inverse(a, b);
  if (!raw) return std::nullopt;
  const Matrix6d of_poses = raw->topLeftCorner<6, 6>();
  const Matrix6d covariance = datum_ ? datum_->between(a, b, of_poses) : of_poses;
  return Matrix6d(world::plain_from_world_error(graph_.tags[first].X_WT.p) * covariance *
                  world::plain_from_world_error(graph_.tags[second].X_WT.p).transpose());
}

std::optional<Eigen::MatrixXd> GraphCovariance::of(const GraphSegment& segment) const {
  const int body = variables_.body(static_cast<std::size_t>(graph_.nodes[segment.begin].body));
  std::vector<Datum::Rows> rows{{variables_.node(segment.begin), 15, true},
                                {variables_.node(segment.end), 15, true},
                                {body, H_.size(body), false}};
  for (const std::size_t i : segment.tags)
    rows.push_back({variables_.tag(i), segment_layout::kTagSize, true});
  if (segment.raw.has_imu()) rows.push_back({variables_.gravity(), 1, false});
  const Eigen::Index numbers = segment.factor.H.rows();
  Eigen::Index prints = 0;  // a segment without tags is not bound to them
  if (!segment.tags.empty()) {
    rows.push_back({variables_.prints(), 1, false});
    prints = 1;
  }
  Eigen::MatrixXd raw(numbers + prints, numbers + prints);
  Eigen::Index row = 0;
  for (const Datum::Rows& a : rows) {
    Eigen::Index column = 0;
    for (const Datum::Rows& b : rows) {
      const auto block = factor_.inverse(a.variable, b.variable);
      if (!block) return std::nullopt;
      raw.block(row, column, a.size, b.size) = *block;
      column += b.size;
    }
    row += a.size;
  }
  if (datum_) raw = datum_->of(rows, raw);
  // A tag's print is larger by what all are, and by what it is beyond.
  const int cameras = static_cast<int>(segment.factor.cameras.size());
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    const int at = segment_layout::scale(cameras, static_cast<int>(i));
    raw.row(at) += raw.row(numbers);
    raw.col(at) += raw.col(numbers);
  }
  return Eigen::MatrixXd(raw.topLeftCorner(numbers, numbers));
}

double GraphCovariance::variance(int variable, int row) const {
  return (*factor_.inverse(variable, variable))(row, row);
}

Eigen::MatrixXd GraphCovariance::camera_columns() const {
  Eigen::Index numbers = 0;
  for (std::size_t b = 0; b < graph_.bodies.size(); ++b) numbers += H_.size(variables_.body(b));
  Eigen::MatrixXd units = Eigen::MatrixXd::Zero(H_.rows(), numbers);
  Eigen::Index at = 0;
  for (std::size_t b = 0; b < graph_.bodies.size(); ++b) {
    const int size = H_.size(variables_.body(b));
    units.block(H_.first(variables_.body(b)), at, size, size).setIdentity();
    at += size;
  }
  return factor_.solve(units);
}

Eigen::MatrixXd GraphCovariance::tag_rows(const Eigen::MatrixXd& columns, std::size_t tag) const {
  return world::plain_from_world_error(graph_.tags[tag].X_WT.p) *
         columns.middleRows<6>(H_.first(variables_.tag(tag)));
}

Eigen::MatrixXd GraphCovariance::camera_rows(const Eigen::MatrixXd& columns,
                                             std::size_t body) const {
  const int variable = variables_.body(body);
  return columns.middleRows(H_.first(variable), H_.size(variable));
}

}  // namespace fiducap
