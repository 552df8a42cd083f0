#include "estimation/world/map_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "base/so3.hpp"
#include "estimation/world/tag_entry.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap::world {

namespace {

// Beside the map a filter knows nothing of where the room is: 1-sigma, m and rad, of all of it.
constexpr double kRoom = 1.0;
// Tags of the map that a new one hangs on directly.
constexpr std::size_t kNeighbours = 3;
// Variances of a map are rounded and come from another linearisation than the filter's.
constexpr double kRounding = 1e-14;
constexpr double kMostNegative = 0.01;
// Between what a filter and the map say of a tag: further apart it is another place.
constexpr double kOtherPlace_m = 0.3;
constexpr double kOtherPlace_rad = 0.3;

Matrix6d world_covariance(const Matrix6d& plain, const KnownTag& row, const KnownTag& column) {
  return world_from_plain_error(row.X_WT.p) * plain *
         world_from_plain_error(column.X_WT.p).transpose();
}

/// How a new tag hangs on some that are there: ξ = A ξ_there + its rest.
struct Hanging {
  std::vector<std::size_t> on;
  Eigen::MatrixXd A;
  Matrix6d own;  ///< Covariance of ξ.
};

/// A covariance as near to the matrix as there is.
Matrix6d without_negative(const Eigen::SelfAdjointEigenSolver<Matrix6d>& eigen) {
  const Vector6d values = eigen.eigenvalues().cwiseMax(kRounding);
  return eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
}

/// @param there  places of the others; @param joint  their covariance, six numbers each
Hanging hang(const KnownTag& tag, const std::vector<const KnownTag*>& there,
             const Eigen::MatrixXd& joint, const KnownMap& map) {
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < there.size(); ++i) {
    if (map.between(tag.tag_id, there[i]->tag_id))
      near.emplace_back((tag.X_WT.p - there[i]->X_WT.p).norm(), i);
  }
  std::sort(near.begin(), near.end());
  const Matrix6d own = world_covariance(tag.covariance, tag, tag);
  for (std::size_t count = std::min(kNeighbours, near.size()); count > 0; --count) {
    const auto rows = static_cast<Eigen::Index>(6 * count);
    Eigen::MatrixXd across(6, rows);
    Eigen::MatrixXd among(rows, rows);
    Hanging out;
    for (std::size_t a = 0; a < count; ++a) {
      const std::size_t i = near[a].second;
      out.on.push_back(i);
      across.middleCols<6>(static_cast<Eigen::Index>(6 * a)) =
          world_covariance(*map.between(tag.tag_id, there[i]->tag_id), tag, *there[i]);
      for (std::size_t b = 0; b < count; ++b) {
        among.block<6, 6>(static_cast<Eigen::Index>(6 * a), static_cast<Eigen::Index>(6 * b)) =
            joint.block<6, 6>(static_cast<Eigen::Index>(6 * i),
                              static_cast<Eigen::Index>(6 * near[b].second));
      }
    }
    among.diagonal().array() += kRounding;
    out.A = among.ldlt().solve(across.transpose()).transpose();
    if (!out.A.allFinite()) continue;
    // What is left is a covariance, but for what the map does not say of its neighbours: where that
    // is much, fewer of them say less that is wrong.
    const Matrix6d shared = out.A * among * out.A.transpose();
    const Matrix6d rest = own - shared;
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(0.5 * (rest + rest.transpose()));
    if (count > 1 && eigen.eigenvalues()(0) < -kMostNegative * eigen.eigenvalues()(5)) continue;
    out.own = shared + without_negative(eigen);
    return out;
  }
  return {{}, {}, own};
}

/// Tags of the state that the map has, too.
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

/// Yaw and shift (all of the turn when it is not level) from where the state has a tag to where the
/// map has it.
Pose axes_by(const WorldTag& own, const KnownTag& map, bool level) {
  Eigen::Quaterniond turn = (map.X_WT.q * own.X_WT.q.conjugate()).normalized();
  if (level) {
    const double norm = std::hypot(turn.w(), turn.z());
    turn = norm > 0 ? Eigen::Quaterniond(turn.w() / norm, 0, 0, turn.z() / norm)
                    : Eigen::Quaterniond::Identity();
  }
  return {turn, map.X_WT.p - turn * own.X_WT.p};
}

/// By the tag that most others agree with; those that do not go: the map has them elsewhere, and
/// there they are met again.
std::optional<Pose> agreed_axes(FilterState& state, bool level, Both& both) {
  std::vector<std::size_t> best;
  Pose best_axes;
  for (std::size_t i = 0; i < both.numbers.size(); ++i) {
    const Pose G = axes_by(state.tags[both.numbers[i]], *both.map[i], level);
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
  for (std::size_t k = 0; k < both.numbers.size(); ++k) {
    if (!std::binary_search(best.begin(), best.end(), k)) gone.push_back(both.numbers[k]);
  }
  Both kept;
  for (const std::size_t k : best) {
    const auto before = std::lower_bound(gone.begin(), gone.end(), both.numbers[k]) - gone.begin();
    kept.numbers.push_back(both.numbers[k] - static_cast<std::size_t>(before));
    kept.map.push_back(both.map[k]);
  }
  both = std::move(kept);
  state.remove_tags(gone);
  return best_axes;
}

/// First columns of every pose in the state.
std::vector<int> pose_columns(const FilterState& state) {
  std::vector<int> out{layout::kPosition};
  for (int c = 0; c < state.cameras(); ++c) out.push_back(layout::camera(c));
  for (std::size_t i = 0; i < state.clones.size(); ++i) out.push_back(state.clone_at(i));
  for (std::size_t i = 0; i < state.tags.size(); ++i) out.push_back(state.tag_at(i));
  return out;
}

void forget_room(FilterState& state, bool level) {
  Vector6d unknown = Vector6d::Constant(kRoom * kRoom);
  if (level) unknown.segment<2>(3).setZero();
  auto P = state.P();
  const std::vector<int> poses = pose_columns(state);
  for (const int a : poses)
    for (const int b : poses) P.block<6, 6>(a, b).diagonal() += unknown;
}

}  // namespace

Eigen::MatrixXd joint_covariance(std::span<const KnownTag* const> tags, const KnownMap& map) {
  const auto rows = static_cast<Eigen::Index>(6 * tags.size());
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(rows, rows);
  std::vector<const KnownTag*> there;
  for (const KnownTag* tag : tags) {
    const auto at = static_cast<Eigen::Index>(6 * there.size());
    const Hanging hanging = hang(*tag, there, joint, map);
    joint.block<6, 6>(at, at) = hanging.own;
    for (std::size_t a = 0; a < hanging.on.size(); ++a) {
      joint.block(at, 0, 6, at) +=
          hanging.A.middleCols<6>(static_cast<Eigen::Index>(6 * a)) *
          joint.block(static_cast<Eigen::Index>(6 * hanging.on[a]), 0, 6, at);
    }
    joint.block(0, at, at, 6) = joint.block(at, 0, 6, at).transpose();
    there.push_back(tag);
  }
  return joint;
}

std::optional<Pose> exchange(FilterState& state, const KnownMap& map, bool level) {
  Both both = tags_of_both(state, map);
  const auto axes = agreed_axes(state, level, both);
  if (!axes) return std::nullopt;
  const Pose before = state.X_WB;
  move_axes(state, *axes);
  forget_room(state, level);

  const auto count = static_cast<Eigen::Index>(both.numbers.size());
  const Eigen::MatrixXd R = joint_covariance(both.map, map);
  auto P = state.P();
  Eigen::MatrixXd columns(P.rows(), 6 * count);
  Eigen::VectorXd apart(6 * count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const std::size_t i = both.numbers[static_cast<std::size_t>(k)];
    columns.middleCols<6>(6 * k) = P.middleCols<6>(state.tag_at(i));
    apart.segment<6>(6 * k) =
        world_error_between(state.tags[i].X_WT, both.map[static_cast<std::size_t>(k)]->X_WT);
  }
  Eigen::MatrixXd S(6 * count, 6 * count);
  for (Eigen::Index k = 0; k < count; ++k) {
    S.middleRows<6>(6 * k) =
        columns.middleRows<6>(state.tag_at(both.numbers[static_cast<std::size_t>(k)]));
  }
  S.diagonal().array() += kRounding;
  const Eigen::MatrixXd G = S.ldlt().solve(columns.transpose()).transpose();
  P.noalias() -= (G * (S - R)) * G.transpose();
  const Eigen::MatrixXd GR = G * R;
  for (Eigen::Index k = 0; k < count; ++k) {
    const int at = state.tag_at(both.numbers[static_cast<std::size_t>(k)]);
    P.middleCols<6>(at) = GR.middleCols<6>(6 * k);
    P.middleRows<6>(at) = GR.middleCols<6>(6 * k).transpose();
  }
  for (Eigen::Index a = 0; a < count; ++a) {
    for (Eigen::Index b = 0; b < count; ++b) {
      P.block<6, 6>(state.tag_at(both.numbers[static_cast<std::size_t>(a)]),
                    state.tag_at(both.numbers[static_cast<std::size_t>(b)])) =
          R.block<6, 6>(6 * a, 6 * b);
    }
  }
  P = (0.5 * (P + P.transpose())).eval();
  state.add_error(G * apart);
  for (std::size_t k = 0; k < both.numbers.size(); ++k)
    state.hand_over(both.numbers[k], both.map[k]->X_WT);
  return state.X_WB * before.inverse();
}

void hold_beside(FilterState& state, const KnownTag& tag, const KnownMap& map, Instant at) {
  std::vector<const KnownTag*> there;
  std::vector<int> columns;
  for (std::size_t i = 0; i < state.tags.size(); ++i) {
    const KnownTag* known = state.tags[i].held ? map.find(state.tags[i].tag_id) : nullptr;
    if (known == nullptr) continue;
    there.push_back(known);
    columns.push_back(state.tag_at(i));
  }
  Eigen::MatrixXd joint(6 * static_cast<Eigen::Index>(there.size()),
                        6 * static_cast<Eigen::Index>(there.size()));
  for (std::size_t a = 0; a < there.size(); ++a) {
    for (std::size_t b = 0; b < there.size(); ++b) {
      joint.block<6, 6>(static_cast<Eigen::Index>(6 * a), static_cast<Eigen::Index>(6 * b)) =
          state.P().block<6, 6>(columns[a], columns[b]);
    }
  }
  const Hanging hanging = hang(tag, there, joint, map);
  hold(state, tag, at);
  const int own = state.tag_at(state.tags.size() - 1);
  auto P = state.P();
  P.block<6, 6>(own, own) = hanging.own;
  for (std::size_t a = 0; a < hanging.on.size(); ++a) {
    P.block(own, 0, 6, own) += hanging.A.middleCols<6>(static_cast<Eigen::Index>(6 * a)) *
                               P.block(columns[hanging.on[a]], 0, 6, own);
  }
  P.block(0, own, own, 6) = P.block(own, 0, 6, own).transpose();
}

}  // namespace fiducap::world
