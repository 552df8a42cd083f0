#include "estimation/filter/matrix6.hpp"
#include "estimation/world/tag_entry.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

#include "base/pose.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap::world {

namespace {
// The filter's information about the pose of the workspace is dropped: its 1-sigma.
constexpr double kRoom_m = 1.0;
constexpr double kRoom_rad = 0.1;
// Neighbours in the map on which a new tag is conditioned.
constexpr std::size_t kNeighbours = 3;
// The map's variances are rounded and have another linearisation point.
constexpr double kRounding = 1e-14;
// Most negative eigenvalue of a conditional covariance relative to the largest: below, the
// neighbours contradict each other.
constexpr double kMostNegative = 0.01;
// Largest difference between filter and map of the same tag pose.
constexpr double kOtherPlace_m = 0.3;
constexpr double kOtherPlace_rad = 0.3;

// Errors are plain (position, rotation vector) as in the map: a world-side error turns a tag's tilt
// into metres of shift at a far origin, and common errors are lost in rounding.

/// First of the six rows of a tag in joint matrices.
Eigen::Index first_of(std::size_t tag) { return static_cast<Eigen::Index>(6 * tag); }

/// Error of a new tag given those of others: e = A e_others + rest.
struct Conditional {
  std::vector<std::size_t> on;
  Eigen::MatrixXd A;
  Matrix6d own;  ///< Covariance of e.
};

/// The nearest covariance.
Matrix6d without_negative(const SymmetricEigen6& eigen) {
  const Vector6d values = eigen.values.cwiseMax(kRounding);
  return eigen.V * values.asDiagonal() * eigen.V.transpose();
}

/// @param there  the other tags; @param joint  their covariance, six numbers each
Conditional condition_on(const KnownTag& tag, const std::vector<const KnownTag*>& there,
                         const Eigen::MatrixXd& joint, const KnownMap& map) {
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < there.size(); ++i)
    if (map.between(tag.tag_id, there[i]->tag_id))
      near.emplace_back((tag.X_WT.p - there[i]->X_WT.p).norm(), i);
  std::ranges::sort(near);
  const Matrix6d& own = tag.covariance;
  for (std::size_t count = std::min(kNeighbours, near.size()); count > 0; --count) {
    const auto rows = first_of(count);
    Eigen::MatrixXd across(6, rows);
    Eigen::MatrixXd among(rows, rows);
    Conditional out;
    for (std::size_t a = 0; a < count; ++a) {
      const std::size_t i = near[a].second;
      out.on.push_back(i);
      across.middleCols<6>(first_of(a)) = *map.between(tag.tag_id, there[i]->tag_id);
      for (std::size_t b = 0; b < count; ++b)
        among.block<6, 6>(first_of(a), first_of(b)) =
            joint.block<6, 6>(first_of(i), first_of(near[b].second));
    }
    // Asymmetry by rounding would grow from tag to tag.
    among = (0.5 * (among + among.transpose())).eval();
    among.diagonal().array() += kRounding;
    out.A = among.ldlt().solve(across.transpose()).transpose();
    if (!out.A.allFinite()) continue;
    // The rest is a covariance unless the map lacks correlations of the neighbours: then fewer are
    // used.
    const Matrix6d shared = out.A * among * out.A.transpose();
    const Matrix6d rest = own - shared;
    const SymmetricEigen6 eigen = symmetric_eigen(0.5 * (rest + rest.transpose()));
    if (count > 1 && eigen.values(0) < -kMostNegative * eigen.values(5)) continue;
    out.own = 0.5 * (shared + shared.transpose()) + without_negative(eigen);
    return out;
  }
  return {{}, {}, own};
}

/// Tags of the state that are in the map.
struct Both {
  std::vector<std::size_t> numbers;
  std::vector<const KnownTag*> map;
};

Both tags_of_both(const FilterState& state, const KnownMap& map) {
  Both out;
  for (std::size_t i = 0; i < state.tags.size(); ++i) {
    const KnownTag* known = map.find(state.tags[i].tag_id);
    if (known == nullptr || known->is_exact()) continue;
    out.numbers.push_back(i);
    out.map.push_back(known);
  }
  return out;
}

/// New axes by the tag with most agreeing others. Removes tags that disagree: they have moved in
/// the map.
std::optional<Pose> agreed_axes(FilterState& state, const KnownMap& map, bool level, Both& both) {
  std::vector<std::size_t> best;
  Pose best_axes;
  for (std::size_t i = 0; i < both.numbers.size(); ++i) {
    const Pose G = axes_between(state.tags[both.numbers[i]].X_WT, both.map[i]->X_WT, level);
    std::vector<std::size_t> agreeing;
    for (std::size_t k = 0; k < both.numbers.size(); ++k) {
      const Pose here = G * state.tags[both.numbers[k]].X_WT;
      if ((here.p - both.map[k]->X_WT.p).norm() < kOtherPlace_m &&
          angle_between(here.q, both.map[k]->X_WT.q) < kOtherPlace_rad)
        agreeing.push_back(k);
    }
    if (agreeing.size() <= best.size()) continue;
    best = std::move(agreeing);
    best_axes = G;
  }
  if (best.empty()) return std::nullopt;
  std::vector<std::size_t> gone;
  for (std::size_t k = 0; k < both.numbers.size(); ++k)
    if (!std::ranges::binary_search(best, k)) gone.push_back(both.numbers[k]);
  state.remove_tags(gone);
  both = tags_of_both(state, map);
  return best_axes;
}

void forget_room(FilterState& state, bool level) {
  // Rotation about the body: about a far origin it would be metres.
  Eigen::Matrix<double, 6, 6> common = Matrix6d::Identity();
  common.topRightCorner<3, 3>() = skew(state.X_WB.p);
  Vector6d unknown;
  unknown << Eigen::Vector3d::Constant(kRoom_m * kRoom_m),
      Eigen::Vector3d::Constant(kRoom_rad * kRoom_rad);
  if (level) unknown.segment<2>(3).setZero();
  add_common_error(state, common * unknown.asDiagonal() * common.transpose());
}

/// Columns of the state's covariance with the plain errors of these tags.
Eigen::MatrixXd columns_of(const FilterState& state, const std::vector<std::size_t>& tags) {
  const auto P = state.P();
  Eigen::MatrixXd out(P.rows(), first_of(tags.size()));
  for (std::size_t k = 0; k < tags.size(); ++k) {
    const Matrix6d J = plain_from_world_error(state.tags[tags[k]].X_WT.p);
    out.middleCols<6>(first_of(k)) = P.middleCols<6>(state.tag_at(tags[k])) * J.transpose();
  }
  return out;
}

/// Rows of these tags in such columns, plain as well.
Eigen::MatrixXd rows_of(const FilterState& state, const std::vector<std::size_t>& tags,
                        const Eigen::MatrixXd& columns) {
  Eigen::MatrixXd out(first_of(tags.size()), columns.cols());
  for (std::size_t k = 0; k < tags.size(); ++k)
    out.middleRows<6>(first_of(k)) = plain_from_world_error(state.tags[tags[k]].X_WT.p) *
                                     columns.middleRows<6>(state.tag_at(tags[k]));
  return out;
}

/// Sets columns and rows of these tags in the state's covariance.
void set_tags(FilterState& state, const std::vector<std::size_t>& tags,
              const Eigen::MatrixXd& columns, const Eigen::MatrixXd& joint) {
  auto P = state.P();
  std::vector<Matrix6d> J;
  for (std::size_t k = 0; k < tags.size(); ++k) {
    J.push_back(world_from_plain_error(state.tags[tags[k]].X_WT.p));
    const int at = state.tag_at(tags[k]);
    P.middleCols<6>(at) = columns.middleCols<6>(first_of(k)) * J.back().transpose();
    P.middleRows<6>(at) = P.middleCols<6>(at).transpose();
  }
  for (std::size_t a = 0; a < tags.size(); ++a) {
    for (std::size_t b = 0; b < tags.size(); ++b)
      P.block<6, 6>(state.tag_at(tags[a]), state.tag_at(tags[b])) =
          J[a] * joint.block<6, 6>(first_of(a), first_of(b)) * J[b].transpose();
  }
  P = (0.5 * (P + P.transpose())).eval();
}
}  // namespace

Eigen::MatrixXd joint_covariance(std::span<const KnownTag* const> tags, const KnownMap& map) {
  const auto rows = first_of(tags.size());
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(rows, rows);
  std::vector<const KnownTag*> there;
  for (const KnownTag* tag : tags) {
    const auto at = first_of(there.size());
    const Conditional conditional = condition_on(*tag, there, joint, map);
    joint.block<6, 6>(at, at) = conditional.own;
    for (std::size_t a = 0; a < conditional.on.size(); ++a)
      joint.block(at, 0, 6, at) += conditional.A.middleCols<6>(first_of(a)) *
                                   joint.block(first_of(conditional.on[a]), 0, 6, at);
    joint.block(0, at, at, 6) = joint.block(at, 0, 6, at).transpose();
    there.push_back(tag);
  }
  return joint;
}

std::optional<Pose> exchange(FilterState& state, const KnownMap& map, bool level) {
  Both both = tags_of_both(state, map);
  const auto axes = agreed_axes(state, map, level, both);
  if (!axes) return std::nullopt;
  const Pose before = state.X_WB;
  move_axes(state, *axes);
  forget_room(state, level);

  const Eigen::MatrixXd R = joint_covariance(both.map, map);
  const Eigen::MatrixXd columns = columns_of(state, both.numbers);
  Eigen::MatrixXd S = rows_of(state, both.numbers, columns);
  S.diagonal().array() += kRounding;
  const Eigen::MatrixXd G = S.ldlt().solve(columns.transpose()).transpose();
  Eigen::VectorXd apart(S.rows());
  for (std::size_t k = 0; k < both.numbers.size(); ++k) {
    const Pose& own = state.tags[both.numbers[k]].X_WT;
    apart.segment<6>(first_of(k)) =
        plain_from_world_error(own.p) * world_error_between(own, both.map[k]->X_WT);
  }
  auto P = state.P();
  P.noalias() -= (G * (S - R)) * G.transpose();
  set_tags(state, both.numbers, G * R, R);
  state.add_error(G * apart);
  for (std::size_t k = 0; k < both.numbers.size(); ++k)
    state.hand_over(both.numbers[k], both.map[k]->X_WT);
  return state.X_WB * before.inverse();
}

void hold_beside(FilterState& state, const KnownTag& tag, const KnownMap& map, Instant at) {
  std::vector<const KnownTag*> there;
  std::vector<std::size_t> tags;
  for (std::size_t i = 0; i < state.tags.size(); ++i) {
    const KnownTag* known = state.tags[i].held ? map.find(state.tags[i].tag_id) : nullptr;
    if (known == nullptr) continue;
    there.push_back(known);
    tags.push_back(i);
  }
  const Eigen::MatrixXd columns = columns_of(state, tags);
  const Conditional conditional = condition_on(tag, there, rows_of(state, tags, columns), map);
  KnownTag placed = tag;
  placed.covariance = conditional.own;
  hold(state, placed, at);
  const int own = state.tag_at(state.tags.size() - 1);
  const Matrix6d J = world_from_plain_error(tag.X_WT.p);
  auto P = state.P();
  for (std::size_t a = 0; a < conditional.on.size(); ++a)
    P.block(own, 0, 6, own) += J * conditional.A.middleCols<6>(first_of(a)) *
                               columns.middleCols<6>(first_of(conditional.on[a])).transpose();
  P.block(0, own, own, 6) = P.block(own, 0, 6, own).transpose();
}

}  // namespace fiducap::world
