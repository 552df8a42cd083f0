#include "estimation/estimator_config.hpp"

namespace fiducap {

std::vector<ConfigError> EstimatorConfig::check() const {
  return Checker{"estimator."}
      .within("hand_over_above", hand_over_above, 1, 1000)
      .positive("corner_noise_px", corner_noise_px)
      .within("gate_probability", gate_probability, 0.9, 0.999999)
      .within("max_local_tags", max_local_tags, 1, 1000)
      .positive("branch_evidence", branch_evidence)
      .within("branch_views", branch_views, 1, 100)
      .positive("max_imu_gap_s", max_imu_gap_s)
      .positive("motion_accel_m_s2_rtHz", motion_accel_m_s2_rtHz)
      .positive("motion_angular_rad_s2_rtHz", motion_angular_rad_s2_rtHz)
      .errors;
}

}  // namespace fiducap
