#include "mapping/graph/graph_covariance.hpp"

#include <algorithm>

#include <Eigen/LU>

#include "estimation/segment/segment_smoother.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap {

namespace {

using Common = Eigen::Matrix<double, 6, 4>;

constexpr double kDamping = 1e-12;

/// Jacobian of a common shift and yaw.
Common common_error() {
  Common N = Common::Zero();
  N.topLeftCorner<3, 3>().setIdentity();
  N(5, 3) = 1;
  return N;
}

/// From errors about W's origin to those about where a segment begins.
Eigen::MatrixXd about(const Eigen::Vector3d& origin, const GraphSegment& segment,
                      const Eigen::MatrixXd& covariance) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const Matrix6d Ad = world::adjoint(Pose{Eigen::Quaterniond::Identity(), -origin});
  Eigen::MatrixXd out = covariance;
  const auto transform = [&](int at) {
    out.middleRows<6>(at) = (Ad * out.middleRows<6>(at)).eval();
    out.middleCols<6>(at) = (out.middleCols<6>(at) * Ad.transpose()).eval();
  };
  transform(kBegin);
  transform(kEnd);
  const int cameras = static_cast<int>(segment.factor.cameras.size());
  for (std::size_t i = 0; i < segment.tags.size(); ++i)
    transform(tag(cameras, static_cast<int>(i)));
  return out;
}

PathPose pose_at(const BodyMoment& body, const Eigen::Vector3d& origin, const Matrix6d& error) {
  const Matrix6d J = world::plain_from_world_error(body.X_WB.p - origin);
  return {body.at, body.X_WB, J * error * J.transpose()};
}

/// Adds all instances but the first, which is the last of another segment, unless a chain begins
/// here.
bool add_path(const GraphState& graph, const GraphSegment& segment, bool begins_chain,
              const Eigen::MatrixXd* of_rest, std::vector<PathPose>& out) {
  MotionSegment now = segment_now(graph, segment);
  const std::vector<PathPoint> between = path_between(now);
  if (between.size() + 2 != now.instances.size()) return false;
  const Eigen::Vector3d& origin = now.begin().X_WB.p;
  if (of_rest == nullptr) {
    for (std::size_t k = begins_chain ? 0 : 1; k < now.instances.size(); ++k)
      out.push_back({now.instances[k].body.at, now.instances[k].body.X_WB});
    return true;
  }
  const Eigen::MatrixXd rest = about(origin, segment, *of_rest);
  const auto own = [&](int at) { return Matrix6d(rest.block<6, 6>(at, at)); };
  if (begins_chain) out.push_back(pose_at(now.begin(), origin, own(segment_layout::kBegin)));
  for (std::size_t k = 0; k < between.size(); ++k) {
    const auto by_rest = between[k].by_rest.topRows<6>();
    const Matrix6d error =
        between[k].given.topLeftCorner<6, 6>() + by_rest * rest * by_rest.transpose();
    out.push_back(pose_at(now.instances[k + 1].body, origin, error));
  }
  out.push_back(pose_at(now.end(), origin, own(segment_layout::kEnd)));
  return true;
}

}  // namespace

Datum::Datum(std::span<const std::pair<int, Pose>> defining, const BlockCholesky& factor,
             const BlockMatrix& matrix) {
  for (int i = 0; i < matrix.variables(); ++i) first_.push_back(matrix.first(i));
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& tag : defining) middle += tag.second.p / static_cast<double>(defining.size());
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(matrix.rows(), 4);
  Eigen::Matrix4d BtN = Eigen::Matrix4d::Zero();
  for (const auto& [variable, X_WT] : defining) {
    Common own = Common::Zero();
    if (defining.size() == 1) {
      own.topLeftCorner<3, 3>().setIdentity();
      own.block<3, 3>(3, 0) = skew(X_WT.p);
      own(5, 3) = 1;
    } else {
      const Eigen::Vector3d arm = Eigen::Vector3d::UnitZ().cross(X_WT.p - middle);
      Eigen::Matrix<double, 4, 3> on_place;
      on_place << Eigen::Matrix3d::Identity(), arm.transpose();
      own = (on_place * world::plain_from_world_error(X_WT.p).topRows<3>()).transpose();
    }
    B.middleRows<6>(matrix.first(variable)) += own;
    BtN += own.transpose() * common_error();
  }
  M_ = BtN.inverse();
  C_ = factor.solve(B);
  T_ = B.transpose() * C_;
}

Eigen::MatrixXd Datum::between(const Rows& a, const Rows& b, const Eigen::MatrixXd& raw) const {
  const auto common = [&](const Rows& rows) {
    Eigen::MatrixXd NM = Eigen::MatrixXd::Zero(rows.size, 4);
    if (rows.is_in_workspace) NM.topRows<6>() = common_error() * M_;
    return NM;
  };
  const auto C = [&](const Rows& rows) {
    return C_.middleRows(first_[static_cast<std::size_t>(rows.variable)], rows.size);
  };
  const Eigen::MatrixXd NM = common(b);
  return raw - common(a) * (C(b) - NM * T_).transpose() - C(a) * NM.transpose();
}

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
  for (const GraphPrior::Conditional& conditional : graph.prior.conditionals) {
    for (const std::size_t a : conditional.given) {
      bind(tags[conditional.tag], tags[a]);
      for (const std::size_t b : conditional.given) bind(tags[a], tags[b]);
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

std::optional<GraphCovariance> GraphCovariance::of(const GraphState& graph,
                                                   std::optional<int> only) {
  const GraphVariables variables(graph);
  NormalEquations equations = normal_equations(graph, variables, only);
  auto factor = BlockCholesky::factor(equations.H, kDamping);
  if (!factor) return std::nullopt;
  factor->invert();
  return GraphCovariance(graph, variables, std::move(equations.H), std::move(*factor));
}

void GraphCovariance::refer_to(const std::vector<std::size_t>& tags) {
  std::vector<std::pair<int, Pose>> defining;
  for (const std::size_t i : tags) defining.emplace_back(variables_.tag(i), graph_.tags[i].X_WT);
  datum_.emplace(defining, factor_, H_);
}

std::optional<Eigen::MatrixXd> GraphCovariance::block(const Datum::Rows& a,
                                                      const Datum::Rows& b) const {
  const auto raw = factor_.inverse(a.variable, b.variable);
  if (!raw) return std::nullopt;
  const Eigen::MatrixXd own = raw->topLeftCorner(a.size, b.size);
  return datum_ ? datum_->between(a, b, own) : own;
}

std::optional<Matrix6d> GraphCovariance::between(std::size_t first, std::size_t second) const {
  const auto covariance = block({variables_.tag(first)}, {variables_.tag(second)});
  if (!covariance) return std::nullopt;
  return Matrix6d(world::plain_from_world_error(graph_.tags[first].X_WT.p) * *covariance *
                  world::plain_from_world_error(graph_.tags[second].X_WT.p).transpose());
}

std::optional<Eigen::MatrixXd> GraphCovariance::of(const GraphSegment& segment) const {
  const int body = variables_.body(static_cast<std::size_t>(graph_.nodes[segment.begin].body));
  std::vector<Datum::Rows> rows{{variables_.node(segment.begin), 15},
                                {variables_.node(segment.end), 15},
                                {body, H_.size(body), false}};
  for (const std::size_t i : segment.tags)
    rows.push_back({variables_.tag(i), segment_layout::kTagSize});
  if (segment.raw.has_imu()) rows.push_back({variables_.gravity(), 1, false});
  const Eigen::Index numbers = segment.factor.H.rows();
  // A segment without tags does not depend on the common scale.
  const Eigen::Index scales = segment.tags.empty() ? 0 : 1;
  if (scales > 0) rows.push_back({variables_.common_scale(), 1, false});
  Eigen::MatrixXd all(numbers + scales, numbers + scales);
  Eigen::Index row = 0;
  for (const Datum::Rows& a : rows) {
    Eigen::Index column = 0;
    for (const Datum::Rows& b : rows) {
      const auto covariance = block(a, b);
      if (!covariance) return std::nullopt;
      all.block(row, column, a.size, b.size) = *covariance;
      column += b.size;
    }
    row += a.size;
  }
  // The scale of a tag is the common one plus its own.
  const int cameras = static_cast<int>(segment.factor.cameras.size());
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    const int at = segment_layout::scale(cameras, static_cast<int>(i));
    all.row(at) += all.row(numbers);
    all.col(at) += all.col(numbers);
  }
  return Eigen::MatrixXd(all.topLeftCorner(numbers, numbers));
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

std::optional<std::vector<PathPose>> path_of(int body_id, const GraphState& graph,
                                             const GraphCovariance* covariance, int component) {
  std::vector<PathPose> path;
  std::optional<std::size_t> last;
  for (const GraphSegment& segment : graph.segments) {
    if (segment.raw.body_id != body_id) continue;
    if (graph.nodes[segment.begin].component != component) continue;
    const auto of_rest = covariance != nullptr ? covariance->of(segment) : std::nullopt;
    if (covariance != nullptr && !of_rest) return std::nullopt;
    if (!add_path(graph, segment, last != segment.begin, of_rest ? &*of_rest : nullptr, path))
      return std::nullopt;
    last = segment.end;
  }
  std::ranges::stable_sort(path, [](const PathPose& a, const PathPose& b) { return a.at < b.at; });
  const bool is_finite = std::ranges::all_of(path, [](const PathPose& pose) {
    return pose.X_WB.p.allFinite() && pose.covariance.allFinite();
  });
  return is_finite ? std::optional(std::move(path)) : std::nullopt;
}

}  // namespace fiducap
