#include "estimation/world/filter_state.hpp"

#include <Eigen/LU>
#include <algorithm>

namespace fiducap::world {

namespace {
// m: change of a lever arm that has no effect yet: 0.1 mm at attitude errors of 0.1 rad.
constexpr double kNoticeable_m = 1e-3;

using ErrorRef = Eigen::Ref<const Eigen::VectorXd>;

/// Inverse of moved() for a point.
Eigen::Vector3d before_error(const Eigen::Vector3d& p, const ErrorRef& error) {
  const Eigen::Vector3d phi = error.tail<3>();
  return exp_so3(-phi) * (p - left_jacobian_so3(phi) * error.head<3>());
}

/// Redefines the errors of the cameras. @param now  new error by the camera's and the body's
template <class Now>
void redefine_cameras(FilterState& state, const Now& now) {
  auto P = state.P();
  for (int c = 0; c < state.cameras(); ++c) {
    const int at = layout::camera(c);
    // Rows of P, one column at a time: no allocation.
    for (Eigen::Index k = 0; k < P.cols(); ++k)
      P.col(k).segment<6>(at) =
          now(Vector6d(P.col(k).segment<6>(at)), Vector6d(P.col(k).segment<6>(layout::kPosition)));
    // The own block also from the other side; the rest by symmetry.
    Eigen::Matrix<double, 6, 6> own = P.block<6, 6>(at, at);
    for (Eigen::Index k = 0; k < 6; ++k)
      own.row(k) = now(Vector6d(own.row(k)), Vector6d(P.block<1, 6>(at + k, layout::kPosition)));
    P.middleCols<6>(at) = P.middleRows<6>(at).transpose();
    P.block<6, 6>(at, at) = own;
  }
}
}  // namespace

int PrintSizes::find(int tag_id) const {
  const auto found = std::ranges::find(watched, tag_id, &Watched::tag_id);
  return found == watched.end() ? -1 : static_cast<int>(found - watched.begin());
}

double PrintSizes::factor(int tag_id) const {
  const int own = find(tag_id);
  return 1 + common + (own < 0 ? 0.0 : watched[static_cast<std::size_t>(own)].scale);
}

void FilterState::reset(std::vector<Pose> cameras, std::size_t clone_count) {
  *this = FilterState{};
  X_BV = std::move(cameras);
  clones.resize(clone_count);
  clocks.resize(X_BV.size());
  lenses.resize(X_BV.size());
  covariance.reset(size());
}

void FilterState::clear_column(int at, double sigma) {
  auto all = P();
  all.row(at).setZero();
  all.col(at).setZero();
  all(at, at) = sigma * sigma;
}

void FilterState::forget_clones() {
  for (Clone& clone : clones) clone.image = -1;
}

Pose MovingBody::X_WB_after(double seconds) const {
  return {X_WB.q * exp_so3(seconds * (gyro_B - bias_w)),
          X_WB.p + seconds * v_WB + (0.5 * seconds * seconds) * a_WB};
}

void FilterState::list_held() {
  held_.clear();
  for (std::size_t i = 0; i < tags.size(); ++i)
    if (tags[i].held) held_.push_back(tag_at(i));
}

void FilterState::add_tag(const WorldTag& tag, const Matrix6d& own) {
  tags.push_back(tag);
  covariance.append(own);
  list_held();
}

void FilterState::hand_over(std::size_t i, const Pose& X_WT) {
  tags[i].X_WT = X_WT;
  tags[i].held = true;
  list_held();
}

void FilterState::remove_tags(std::span<const std::size_t> numbers) {
  columns_.clear();
  for (const std::size_t i : numbers) {
    const int watched = sizes.find(tags[i].tag_id);
    if (watched >= 0) {
      clear_column(layout::print(cameras(), watched), 0);
      sizes.watched[static_cast<std::size_t>(watched)] = {};
    }
    columns_.push_back(tag_at(i));
  }
  covariance.erase(columns_);
  for (std::size_t k = numbers.size(); k-- > 0;)
    tags.erase(tags.begin() + static_cast<std::ptrdiff_t>(numbers[k]));
  list_held();
}

void FilterState::add_error(const ErrorRef& error) {
  const Eigen::Vector3d phi = error.segment<3>(layout::kAttitude);
  v_WB = exp_so3(phi) * v_WB + left_jacobian_so3(phi) * error.segment<3>(layout::kVelocity);
  const Pose before = X_WB;
  X_WB = moved(X_WB, error.segment<6>(layout::kPosition));
  for (int c = 0; c < cameras(); ++c) {
    Pose& X = X_BV[static_cast<std::size_t>(c)];
    X = X_WB.inverse() * moved(before * X, error.segment<6>(layout::camera(c)));
    CameraClock& clock = clocks[static_cast<std::size_t>(c)];
    clock.shift_s += error(layout::clock(c));
    clock.readout_s += error(layout::readout(c));
    LensOffset& lens = lenses[static_cast<std::size_t>(c)];
    lens.focal += error(layout::focal(c));
    lens.centre_px += error.segment<2>(layout::centre(c));
    lens.k1 += error(layout::distortion(c));
  }
  sizes.common += error(layout::sizes(cameras()));
  for (std::size_t k = 0; k < sizes.watched.size(); ++k)
    sizes.watched[k].scale += error(layout::print(cameras(), static_cast<int>(k)));
  gravity_offset_m_s2 += error(layout::gravity(cameras()));
  imu.accel_scale += error.segment<3>(layout::accel_scale(cameras()));
  imu.gyro_turn += error.segment<3>(layout::gyro_turn(cameras()));
  imu.gyro_scale += error.segment<3>(layout::gyro_scale(cameras()));
  imu.gyro_drift += error.segment<3>(layout::gyro_drift(cameras()));
  bias_f += error.segment<3>(layout::kBiasF);
  bias_w += error.segment<3>(layout::kBiasW);
  for (std::size_t i = 0; i < clones.size(); ++i)
    clones[i].X_WV = moved(clones[i].X_WV, error.segment<6>(clone_at(i)));
  for (std::size_t i = 0; i < tags.size(); ++i)
    tags[i].X_WT = moved(tags[i].X_WT, error.segment<6>(tag_at(i)));
}

Eigen::VectorXd FilterState::error_to(const FilterState& other) const {
  Eigen::VectorXd error(size());
  error.segment<6>(layout::kPosition) = world_error_between(X_WB, other.X_WB);
  error.segment<3>(layout::kVelocity) =
      left_jacobian_so3(error.segment<3>(layout::kAttitude)).inverse() *
      (other.v_WB - (other.X_WB.q * X_WB.q.conjugate()) * v_WB);
  error.segment<3>(layout::kBiasF) = other.bias_f - bias_f;
  error.segment<3>(layout::kBiasW) = other.bias_w - bias_w;
  for (int c = 0; c < cameras(); ++c) {
    error.segment<6>(layout::camera(c)) = world_error_between(X_WV(c), other.X_WV(c));
    const CameraClock& here = clocks[static_cast<std::size_t>(c)];
    const CameraClock& there = other.clocks[static_cast<std::size_t>(c)];
    const LensOffset& lens = lenses[static_cast<std::size_t>(c)];
    const LensOffset& other_lens = other.lenses[static_cast<std::size_t>(c)];
    error.segment<3>(layout::clock(c)) << there.shift_s - here.shift_s,
        there.readout_s - here.readout_s, other_lens.focal - lens.focal;
    error.segment<3>(layout::centre(c)) << other_lens.centre_px - lens.centre_px,
        other_lens.k1 - lens.k1;
  }
  error(layout::sizes(cameras())) = other.sizes.common - sizes.common;
  for (std::size_t k = 0; k < sizes.watched.size(); ++k)
    error(layout::print(cameras(), static_cast<int>(k))) =
        other.sizes.watched[k].scale - sizes.watched[k].scale;
  error(layout::gravity(cameras())) = other.gravity_offset_m_s2 - gravity_offset_m_s2;
  error.segment<12>(layout::accel_scale(cameras())) << other.imu.accel_scale - imu.accel_scale,
      other.imu.gyro_turn - imu.gyro_turn, other.imu.gyro_scale - imu.gyro_scale,
      other.imu.gyro_drift - imu.gyro_drift;
  for (std::size_t i = 0; i < clones.size(); ++i)
    error.segment<6>(clone_at(i)) = world_error_between(clones[i].X_WV, other.clones[i].X_WV);
  for (std::size_t i = 0; i < tags.size(); ++i)
    error.segment<6>(tag_at(i)) = world_error_between(tags[i].X_WT, other.tags[i].X_WT);
  return error;
}

void camera_errors_to_extrinsics(FilterState& state) {
  const Matrix6d to_body = adjoint(state.X_WB.inverse());
  redefine_cameras(state, [&](const auto& camera, const auto& body) -> Vector6d {
    return to_body * (camera - body);
  });
}

void extrinsics_to_camera_errors(FilterState& state) {
  const Matrix6d to_world = adjoint(state.X_WB);
  redefine_cameras(state, [&](const auto& camera, const auto& body) -> Vector6d {
    return to_world * camera + body;
  });
}

void transport_covariance(FilterState& state, const ErrorRef& correction, int camera) {
  auto P = state.P();
  const int turn_V = layout::camera(camera) + 3;
  const auto transport = [&](int at, const Eigen::Vector3d& moved) {
    const Eigen::Matrix3d J = skew(moved);
    auto columns = P.middleCols<3>(at);
    columns += P.middleCols<3>(at + 3).lazyProduct(J.transpose());
    columns -= P.middleCols<3>(turn_V).lazyProduct(J.transpose());
    // The own block also from the other side; the rest by symmetry.
    Eigen::Matrix3d own = columns.middleRows<3>(at);
    own += J * (columns.middleRows<3>(at + 3) - columns.middleRows<3>(turn_V));
    P.middleRows<3>(at) = columns.transpose();
    P.block<3, 3>(at, at) = own;
  };
  const auto change = [&](int at, const Eigen::Vector3d& p) -> Eigen::Vector3d {
    return p - before_error(p, correction.segment<6>(at));
  };
  transport(layout::kPosition, change(layout::kPosition, state.X_WB.p));
  for (int c = 0; c < state.cameras(); ++c)
    if (c != camera) transport(layout::camera(c), change(layout::camera(c), state.X_WV(c).p));
  for (std::size_t i = 0; i < state.tags.size(); ++i) {
    WorldTag& tag = state.tags[i];
    tag.not_transported += change(state.tag_at(i), tag.X_WT.p);
    if (tag.not_transported.squaredNorm() < kNoticeable_m * kNoticeable_m) continue;
    transport(state.tag_at(i), tag.not_transported);
    tag.not_transported.setZero();
  }
}

Matrix6d extrinsics_covariance(const FilterState& state, int camera) {
  const int at = layout::camera(camera);
  const auto P = state.P();
  const Matrix6d apart = P.block<6, 6>(at, at) - P.block<6, 6>(at, layout::kPosition) -
                         P.block<6, 6>(layout::kPosition, at) +
                         P.block<6, 6>(layout::kPosition, layout::kPosition);
  const Matrix6d J = plain_from_world_error(state.X_BV[static_cast<std::size_t>(camera)].p) *
                     adjoint(state.X_WB.inverse());
  return J * apart * J.transpose();
}

BodyEstimate body_in_workspace(const FilterState& state) {
  static_assert(layout::kPosition == estimate_block::kPosition &&
                layout::kAttitude == estimate_block::kAttitude &&
                layout::kVelocity == estimate_block::kVelocity &&
                layout::kBiasF == estimate_block::kBiasF &&
                layout::kBiasW == estimate_block::kBiasW);
  BodyEstimate out;
  out.at = state.time;
  out.X_WB = state.X_WB;
  out.v_WB = state.v_WB;
  out.bias_f = state.bias_f;
  out.bias_w = state.bias_w;
  out.gravity_offset_m_s2 = state.gravity_offset_m_s2;
  out.imu = state.imu;
  // J P Jᵀ, with J the identity plus the effect of rotation on position and velocity.
  out.covariance = state.P().topLeftCorner<layout::kBodySize, layout::kBodySize>();
  const auto turn = [&](int moved, const Eigen::Vector3d& arm) {
    const Eigen::Matrix3d J = -skew(arm);
    auto& P = out.covariance;
    P.middleRows<3>(moved) += J.lazyProduct(P.middleRows<3>(layout::kAttitude));
    P.middleCols<3>(moved) += P.middleCols<3>(layout::kAttitude).lazyProduct(J.transpose());
  };
  turn(layout::kPosition, state.X_WB.p);
  turn(layout::kVelocity, state.v_WB);
  return out;
}

KnownTag tag_in_workspace(const FilterState& state, std::size_t tag) {
  const WorldTag& t = state.tags[tag];
  const Matrix6d J = plain_from_world_error(t.X_WT.p);
  const Matrix6d own = state.P().block<6, 6>(state.tag_at(tag), state.tag_at(tag));
  return {t.tag_id, t.edge_m, t.X_WT, J * own * J.transpose()};
}

}  // namespace fiducap::world
