#include "estimation/world/workspace_axes.hpp"

#include <cmath>
#include <utility>

#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap::world {

using namespace layout;  // NOLINT: block names

namespace {
/// A motion of the whole workspace, g = (translation, rotation): four numbers with gravity (yaw
/// only), six without.
struct RoomShift {
  Matrix6d N{Matrix6d::Zero()};  ///< ξ ← ξ + N g, the same for every pose
  Matrix6d L{Matrix6d::Zero()};  ///< g = L ξ_T removes the reference tag's own error
};

RoomShift shift_for(const Pose& X_WT, const HeadingRule& rule, bool level) {
  if (!level) return {Matrix6d::Identity(), -Matrix6d::Identity()};
  const Eigen::Vector3d h = X_WT.q * Eigen::Vector3d::Unit(rule.axis);  // the tag's heading axis
  RoomShift shift;
  shift.N.topLeftCorner<3, 3>().setIdentity();
  shift.N(5, 3) = 1;
  const double level2 = h.x() * h.x() + h.y() * h.y();
  const Eigen::RowVector3d heading =
      -Eigen::RowVector3d(-h.y() / level2, h.x() / level2, 0) * skew(h);  // ∂ yaw of h / ∂ φ
  // ψ = −heading φ;  t = −ρ + p × (φ + ψ z): position ρ + φ × p and heading end at zero.
  shift.L.block<1, 3>(3, 3) = -heading;
  shift.L.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
  shift.L.topRightCorner<3, 3>() =
      skew(X_WT.p) * (Eigen::Matrix3d::Identity() - Eigen::Vector3d::UnitZ() * heading);
  return shift;
}

/// First columns of all poses in the state: body, cameras, clones, tags.
int pose_at(const FilterState& state, std::size_t k) {
  const auto cameras = static_cast<std::size_t>(state.cameras());
  if (k == 0) return kPosition;
  return k <= cameras ? layout::camera(static_cast<int>(k) - 1)
                      : layout::tag(state.cameras(), static_cast<int>(k - 1 - cameras));
}
std::size_t poses(const FilterState& state) {
  return 1 + static_cast<std::size_t>(state.cameras()) + state.clones.size() + state.tags.size();
}

/// Change of errors with the axes: of every pose by `turn` and by `shift` of the tag's earlier
/// error.
struct ErrorChange {
  Matrix6d turn;
  Eigen::Matrix3d turn_velocity;
  int tag_at{-1};  ///< −1: no shift.
  Matrix6d shift{Matrix6d::Zero()};
};

/// P ← T P, column by column.
void change_rows(FilterState& state, const ErrorChange& change) {
  auto P = state.P();
  for (Eigen::Index k = 0; k < P.cols(); ++k) {
    auto column = P.col(k);
    Vector6d shift = Vector6d::Zero();
    if (change.tag_at >= 0) shift.noalias() = change.shift * column.segment<6>(change.tag_at);
    for (std::size_t i = 0; i < poses(state); ++i) {
      auto error = column.segment<6>(pose_at(state, i));
      const Vector6d turned = shift + change.turn * error;
      error = turned;
    }
    const Eigen::Vector3d velocity = change.turn_velocity * column.segment<3>(kVelocity);
    column.segment<3>(kVelocity) = velocity;
  }
}

/// P ← T P Tᵀ: twice the rows, because P is symmetric.
void change_errors(FilterState& state, const ErrorChange& change) {
  change_rows(state, change);
  state.P().transposeInPlace();
  change_rows(state, change);
}

void move_mean(FilterState& state, const Pose& G) {
  state.X_WB = G * state.X_WB;
  state.v_WB = G.q * state.v_WB;
  for (Clone& clone : state.clones) clone.X_WV = G * clone.X_WV;
  state.a_WB = G.q * state.a_WB;
  for (WorldTag& tag : state.tags) tag.X_WT = G * tag.X_WT;
}
}  // namespace

void move_axes(FilterState& state, const Pose& G) {
  move_mean(state, G);
  change_errors(state, {.turn = adjoint(G), .turn_velocity = G.rotation()});
}

Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level) {
  const Pose& X_WT = state.tags[tag].X_WT;
  Pose G;
  G.q = level ? turn_to_heading(rule, X_WT.q) : (rule.X_WT.q * X_WT.q.conjugate()).normalized();
  G.p = rule.X_WT.p - G.q * X_WT.p;
  move_mean(state, G);
  // Then the motion of the workspace by the tag's own error is removed: ξ ← ξ + N L ξ_T.
  const RoomShift shift = shift_for(state.tags[tag].X_WT, rule, level);
  const Matrix6d turn = adjoint(G);
  change_errors(state, {turn, G.rotation(), state.tag_at(tag), shift.N * shift.L * turn});
  return G;
}

ReferenceSlack slack_of_reference(const FilterState& state, std::size_t tag,
                                  const HeadingRule& rule, bool level) {
  const WorldTag& reference = state.tags[tag];
  const RoomShift shift = shift_for(reference.X_WT, rule, level);
  const Matrix6d own = state.P().block<6, 6>(state.tag_at(tag), state.tag_at(tag));
  const double variance = (shift.L * own * shift.L.transpose()).trace();
  const double turn = level ? log_so3(turn_to_heading(rule, reference.X_WT.q)).norm()
                            : angle_between(rule.X_WT.q, reference.X_WT.q);
  return {turn + (reference.X_WT.p - rule.X_WT.p).norm(), std::sqrt(std::max(0.0, variance))};
}

void add_common_error(FilterState& state, const Matrix6d& covariance) {
  for (std::size_t a = 0; a < poses(state); ++a) {
    for (std::size_t b = 0; b < poses(state); ++b)
      state.P().block<6, 6>(pose_at(state, a), pose_at(state, b)) += covariance;
  }
}

Pose anchor_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT,
                     bool level) {
  const Pose seen = state.X_WV(camera) * X_VT;
  const Pose G = axes_between(seen, X_WT, level);
  move_axes(state, G);
  Vector6d unknown;
  unknown << Eigen::Vector3d::Constant(kUnknownPosition_m), 0, 0, kUnknownAngle_rad;
  if (!level) unknown.tail<3>().setConstant(kUnknownAngle_rad);
  add_common_error(state, unknown.cwiseAbs2().asDiagonal());
  return G;
}

Pose anchor_local_to_known(FilterState& state, std::size_t tag, const Pose& X_WT, bool level) {
  return anchor_to_known(state, 0, state.X_WV(0).inverse() * state.tags[tag].X_WT, X_WT, level);
}

void forget_motion(FilterState& state, const Pose& X_WB, bool has_imu) {
  camera_errors_to_extrinsics(state);
  state.X_WB = X_WB;
  state.v_WB.setZero();
  auto P = state.P();
  P.topRows<kBiasF>().setZero();
  P.leftCols<kBiasF>().setZero();
  P.diagonal().segment<3>(kPosition).setConstant(kUnknownPosition_m * kUnknownPosition_m);
  P.diagonal().segment<3>(kAttitude).setConstant(kUnknownAngle_rad * kUnknownAngle_rad);
  P.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (!has_imu) {
    state.bias_w.setZero();
    P.middleRows<3>(kBiasW).setZero();
    P.middleCols<3>(kBiasW).setZero();
    P.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  extrinsics_to_camera_errors(state);
}

using namespace layout;        // NOLINT: block names
using namespace filter_rules;  // NOLINT: short names

namespace {
constexpr double kExactReadout_s = 5.1e-5;

void reset_camera(FilterState& state, const BodySensors& sensors, const EstimatorConfig& config,
                  const ClockHypothesis& clocks, int camera) {
  const auto k = static_cast<std::size_t>(camera);
  const CameraMount& mount = sensors.cameras[k];
  auto P = state.P();
  if (config.estimate_extrinsics) {
    Matrix6d plain = Matrix6d::Zero();
    plain.diagonal().head<3>().setConstant(mount.position_sigma_m * mount.position_sigma_m);
    plain.diagonal().tail<3>().setConstant(mount.rotation_sigma_rad * mount.rotation_sigma_rad);
    const Matrix6d J = world_from_plain_error(mount.X_BV.p);
    P.block<6, 6>(layout::camera(camera), layout::camera(camera)) =
        J * plain * J.transpose();  // the body is at the origin
  }
  state.clocks[k] = {.shift_s = clocks.shifts_s[k],
                     .readout_s = mount.readout_s,
                     .rows_apart = mount.readout_s != 0 || mount.readout_sigma_s != 0};
  // Without an IMU there is no reference clock.
  if (!config.estimate_clocks || !sensors.imu) return;
  P(readout(camera), readout(camera)) = mount.readout_sigma_s * mount.readout_sigma_s;
  open_clock(state, sensors, config, camera, clocks.sigma_s(mount.time_shift_sigma_s));
}
}  // namespace

void reset(FilterState& state, const BodySensors& sensors, const EstimatorConfig& config,
           const ClockHypothesis& clocks, std::size_t clones) {
  std::vector<Pose> X_BV;
  for (const CameraMount& mount : sensors.cameras) X_BV.push_back(mount.X_BV);
  state.reset(std::move(X_BV), clones);
  for (int c = 0; c < state.cameras(); ++c) reset_camera(state, sensors, config, clocks, c);
  if (sensors.imu) state.clear_column(gravity(state.cameras()), sensors.gravity_sigma_m_s2);
}

void start(FilterState& state, Instant at, const std::optional<Eigen::Quaterniond>& q_WB) {
  camera_errors_to_extrinsics(state);
  auto P = state.P();
  P.topRows<kBodySize>().setZero();
  P.leftCols<kBodySize>().setZero();
  state.time = at;
  state.X_WB = Pose{};
  state.v_WB.setZero();
  P.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (q_WB) {
    state.X_WB.q = *q_WB;
    P.diagonal().segment<2>(kAttitude).setConstant(kStartTilt_rad * kStartTilt_rad);
    P.diagonal().segment<3>(kBiasF).setConstant(kStartBiasF_m_s2 * kStartBiasF_m_s2);
    P.diagonal().segment<3>(kBiasW).setConstant(kStartBiasW_rad_s * kStartBiasW_rad_s);
  } else {
    P.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  extrinsics_to_camera_errors(state);
}

void open_clock(FilterState& state, const BodySensors& sensors, const EstimatorConfig& config,
                int camera, double sigma_s) {
  if (!config.estimate_clocks || !sensors.imu) return;
  state.clear_column(layout::clock(camera), sigma_s);
}

ClockEstimate clock_of(const FilterState& state, int camera) {
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  const int at = layout::clock(camera);
  const double readout_sigma_s = std::sqrt(state.P()(at + 1, at + 1));
  // As configured.
  const bool is_exact = !clock.rows_apart && readout_sigma_s < kExactReadout_s;
  return {clock.shift_s, std::sqrt(state.P()(at, at)), is_exact ? 0.0 : clock.readout_s,
          is_exact ? 0.0 : readout_sigma_s};
}

}  // namespace fiducap::world
