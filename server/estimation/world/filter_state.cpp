#include "estimation/world/filter_state.hpp"

#include <Eigen/LU>

#include "base/so3.hpp"

namespace fiducap::world {

namespace {

using ErrorRef = Eigen::Ref<const Eigen::VectorXd>;

/// The group's own exponential: a turning about the tag's centre leaves the centre where it is, however far away the
/// origin of W is and however large the turning.
void add_world_error(Pose& X, const ErrorRef& error) {
  const Eigen::Vector3d phi = error.tail<3>();
  const Eigen::Quaterniond turn = exp_so3(phi);
  X.q = (turn * X.q).normalized();
  X.p = turn * X.p + left_jacobian_so3(phi) * error.head<3>();
}

/// Inverse of add_world_error. @return the left Jacobian of the turning
Eigen::Matrix3d world_error(const Pose& from, const Pose& to, Eigen::Ref<Eigen::VectorXd> error) {
  const Eigen::Quaterniond turn = to.q * from.q.conjugate();
  error.tail<3>() = log_so3(turn);
  const Eigen::Matrix3d J = left_jacobian_so3(error.tail<3>());
  error.head<3>() = J.inverse() * (to.p - turn * from.p);
  return J;
}

}  // namespace

void FilterState::reset(std::vector<Pose> cameras) {
  *this = FilterState{};
  X_BV = std::move(cameras);
  covariance.reset(size());
}

void FilterState::list_held() {
  held_.clear();
  for (std::size_t i = 0; i < tags.size(); ++i) {
    if (tags[i].held) held_.push_back(tag_at(i));
  }
}

void FilterState::add_tag(const WorldTag& tag, const Matrix6d& own) {
  tags.push_back(tag);
  covariance.append(own);
  list_held();
}

void FilterState::remove_tag(std::size_t i) {
  covariance.erase(tag_at(i));
  tags.erase(tags.begin() + static_cast<std::ptrdiff_t>(i));
  list_held();
}

void FilterState::copy_mean(const FilterState& other) {
  time = other.time;
  X_WB = other.X_WB;
  v_WB = other.v_WB;
  bias_f = other.bias_f;
  bias_w = other.bias_w;
  X_BV = other.X_BV;
  for (std::size_t i = 0; i < tags.size(); ++i) tags[i].X_WT = other.tags[i].X_WT;
}

void FilterState::add_error(const ErrorRef& error) {
  const Eigen::Vector3d phi = error.segment<3>(layout::kAttitude);
  v_WB = exp_so3(phi) * v_WB + left_jacobian_so3(phi) * error.segment<3>(layout::kVelocity);
  add_world_error(X_WB, error.segment<6>(layout::kPosition));
  bias_f += error.segment<3>(layout::kBiasF);
  bias_w += error.segment<3>(layout::kBiasW);
  for (int c = 0; c < cameras(); ++c) {
    Pose& X = X_BV[static_cast<std::size_t>(c)];
    X.p += error.segment<3>(layout::extrinsics(c));
    X.q = (exp_so3(error.segment<3>(layout::extrinsics(c) + 3)) * X.q).normalized();
  }
  for (std::size_t i = 0; i < tags.size(); ++i) add_world_error(tags[i].X_WT, error.segment<6>(tag_at(i)));
}

Eigen::VectorXd FilterState::error_to(const FilterState& other) const {
  Eigen::VectorXd error(size());
  const Eigen::Matrix3d J = world_error(X_WB, other.X_WB, error.segment<6>(layout::kPosition));
  error.segment<3>(layout::kVelocity) = J.inverse() * (other.v_WB - (other.X_WB.q * X_WB.q.conjugate()) * v_WB);
  error.segment<3>(layout::kBiasF) = other.bias_f - bias_f;
  error.segment<3>(layout::kBiasW) = other.bias_w - bias_w;
  for (int c = 0; c < cameras(); ++c) {
    const Pose& from = X_BV[static_cast<std::size_t>(c)];
    const Pose& to = other.X_BV[static_cast<std::size_t>(c)];
    error.segment<3>(layout::extrinsics(c)) = to.p - from.p;
    error.segment<3>(layout::extrinsics(c) + 3) = log_so3(to.q * from.q.conjugate());
  }
  for (std::size_t i = 0; i < tags.size(); ++i) {
    world_error(tags[i].X_WT, other.tags[i].X_WT, error.segment<6>(tag_at(i)));
  }
  return error;
}

Matrix6d plain_from_world_error(const Eigen::Vector3d& p) {
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = -skew(p);
  return J;
}

Matrix6d world_from_plain_error(const Eigen::Vector3d& p) {
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = skew(p);
  return J;
}

BodyEstimate body_in_workspace(const FilterState& state) {
  static_assert(layout::kPosition == estimate_block::kPosition && layout::kAttitude == estimate_block::kAttitude &&
                layout::kVelocity == estimate_block::kVelocity && layout::kBiasF == estimate_block::kBiasF &&
                layout::kBiasW == estimate_block::kBiasW);
  BodyEstimate out;
  out.at = state.time;
  out.X_WB = state.X_WB;
  out.v_WB = state.v_WB;
  out.bias_f = state.bias_f;
  out.bias_w = state.bias_w;
  BodyMatrix J = BodyMatrix::Identity();
  J.topLeftCorner<6, 6>() = plain_from_world_error(state.X_WB.p);
  J.block<3, 3>(layout::kVelocity, layout::kAttitude) = -skew(state.v_WB);
  const BodyMatrix P = state.P().topLeftCorner<layout::kBodySize, layout::kBodySize>();
  out.covariance = J * P * J.transpose();
  return out;
}

KnownTag tag_in_workspace(const FilterState& state, std::size_t tag) {
  const WorldTag& t = state.tags[tag];
  const Matrix6d J = plain_from_world_error(t.X_WT.p);
  const Matrix6d own = state.P().block<6, 6>(state.tag_at(tag), state.tag_at(tag));
  return {t.tag_id, t.edge_m, t.X_WT, J * own * J.transpose()};
}

}  // namespace fiducap::world
