#include "estimation/world/initial_state.hpp"

#include <cmath>
#include <utility>

#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap::world {

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
