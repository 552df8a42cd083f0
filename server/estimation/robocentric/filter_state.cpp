#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

namespace {
void add_left(Pose& X, const Eigen::Ref<const Eigen::VectorXd>& error) {
  X.p += error.head<3>();
  X.q = (exp_so3(error.tail<3>()) * X.q).normalized();
}

void left_error(const Pose& from, const Pose& to, Eigen::Ref<Eigen::VectorXd> error) {
  error.head<3>() = to.p - from.p;
  error.tail<3>() = log_so3(to.q * from.q.conjugate());
}
}  // namespace

void FilterState::add_tag(const LocalTag& tag, const Matrix6d& own) {
  tags.push_back(tag);
  covariance.append(own);
}

void FilterState::remove_tag(std::size_t i) {
  const int at = tag_at(i);
  covariance.erase({&at, 1});
  tags.erase(tags.begin() + static_cast<std::ptrdiff_t>(i));
}

void FilterState::add_error(const Eigen::Ref<const Eigen::VectorXd>& error) {
  p_WB_B += error.segment<3>(layout::kPosition);
  v_WB_B += error.segment<3>(layout::kVelocity);
  q_WB = (q_WB * exp_so3(error.segment<3>(layout::kAttitude))).normalized();
  bias_f += error.segment<3>(layout::kBiasF);
  bias_w += error.segment<3>(layout::kBiasW);
  for (int c = 0; c < cameras(); ++c)
    add_left(X_BV[static_cast<std::size_t>(c)], error.segment<6>(layout::extrinsics(c)));
  for (std::size_t i = 0; i < tags.size(); ++i) add_left(tags[i].X_VT, error.segment<6>(tag_at(i)));
}

Eigen::VectorXd FilterState::error_to(const FilterState& other) const {
  Eigen::VectorXd error(size());
  error.segment<3>(layout::kPosition) = other.p_WB_B - p_WB_B;
  error.segment<3>(layout::kVelocity) = other.v_WB_B - v_WB_B;
  error.segment<3>(layout::kAttitude) = log_so3(q_WB.conjugate() * other.q_WB);
  error.segment<3>(layout::kBiasF) = other.bias_f - bias_f;
  error.segment<3>(layout::kBiasW) = other.bias_w - bias_w;
  for (int c = 0; c < cameras(); ++c) {
    const auto k = static_cast<std::size_t>(c);
    left_error(X_BV[k], other.X_BV[k], error.segment<6>(layout::extrinsics(c)));
  }
  for (std::size_t i = 0; i < tags.size(); ++i)
    left_error(tags[i].X_VT, other.tags[i].X_VT, error.segment<6>(tag_at(i)));
  return error;
}

BodyEstimate body_in_workspace(const FilterState& state) {
  namespace eb = estimate_block;
  BodyEstimate out;
  const Eigen::Matrix3d R = state.q_WB.toRotationMatrix();
  out.at = state.time;
  out.X_WB = state.X_WB();
  out.v_WB = R * state.v_WB_B;
  out.bias_f = state.bias_f;
  out.bias_w = state.bias_w;
  Eigen::Matrix<double, 15, layout::kBodySize> J =
      Eigen::Matrix<double, 15, layout::kBodySize>::Zero();
  J.block<3, 3>(eb::kPosition, layout::kPosition) = R;
  J.block<3, 3>(eb::kPosition, layout::kAttitude) = -R * skew(state.p_WB_B);
  J.block<3, 3>(eb::kAttitude, layout::kAttitude) = R;
  J.block<3, 3>(eb::kVelocity, layout::kVelocity) = R;
  J.block<3, 3>(eb::kVelocity, layout::kAttitude) = -R * skew(state.v_WB_B);
  J.block<3, 3>(eb::kBiasF, layout::kBiasF).setIdentity();
  J.block<3, 3>(eb::kBiasW, layout::kBiasW).setIdentity();
  const BodyMatrix P_bb = state.P().topLeftCorner<layout::kBodySize, layout::kBodySize>();
  out.covariance = J * P_bb * J.transpose();
  return out;
}

}  // namespace fiducap::robocentric
