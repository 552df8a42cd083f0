#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "base/pose.hpp"
#include "base/time.hpp"

namespace fiducap {

using Matrix15d = Eigen::Matrix<double, 15, 15>;

/// First row of each block of BodyEstimate::covariance.
namespace estimate_block {
inline constexpr int kPosition = 0;  ///< p_WB, m, W axes.
inline constexpr int kAttitude = 3;  ///< rotation vector in W axes: q_WB = exp(δ) q̂_WB.
inline constexpr int kVelocity = 6;  ///< v_WB, m/s, W axes.
inline constexpr int kBiasF = 9;     ///< accelerometer bias, m/s², B axes.
inline constexpr int kBiasW = 12;  ///< gyro bias, rad/s, B axes (without IMU: minus the body rate).
}  // namespace estimate_block

/// Deterministic errors of the IMU beyond its biases: f_measured = (1 + accel_scale) f + bias and
/// w_measured = exp(gyro_turn) (1 + gyro_scale) w + bias, scales per axis; the gyro's bias changes
/// by gyro_drift per second, as with temperature.
struct ImuIntrinsics {
  Eigen::Vector3d accel_scale{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gyro_turn{Eigen::Vector3d::Zero()};  ///< Against the accelerometer, rad.
  Eigen::Vector3d gyro_scale{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gyro_drift{Eigen::Vector3d::Zero()};  ///< rad/s².

  /// @param measured  bias removed
  [[nodiscard]] Eigen::Vector3d force(const Eigen::Vector3d& measured) const {
    return measured.array() / (1 + accel_scale.array());
  }
  /// @param measured  bias removed
  [[nodiscard]] Eigen::Vector3d rate(const Eigen::Vector3d& measured) const {
    return (exp_so3(-gyro_turn) * measured).array() / (1 + gyro_scale.array());
  }
};

/// The state of one body at one instant, mean and covariance.
struct BodyEstimate {
  Instant at{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};    ///< Velocity of B's origin, W axes, m/s.
  Eigen::Vector3d w_WB_B{Eigen::Vector3d::Zero()};  ///< Body rate, B axes, rad/s, bias removed.
  /// Coordinate acceleration, W axes, m/s² (at rest 0).
  Eigen::Vector3d a_WB{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  ImuIntrinsics imu{};
  Matrix15d covariance{Matrix15d::Zero()};
  double gravity_offset_m_s2{};  ///< Gravity minus BodySensors::gravity_m_s2.
  bool anchored{};               ///< W is the workspace. False: axes of this filter's own.
};

/// Position of the body, W axes, m.
struct BodyPlace {
  Eigen::Vector3d p_WB{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Zero()};

  /// 1-sigma, of all three axes together.
  [[nodiscard]] double sigma_m() const { return std::sqrt(covariance.trace()); }
};

/// Result of one update. A rejected tag is a value, not a log line or an exception.
struct UpdateReport {
  static constexpr std::size_t kMostNamed = 8;
  static constexpr std::size_t kMostFitting = 16;

  Instant exposed_at{};
  int tags_seen{};
  int tags_used{};
  int tags_rejected{};  ///< Failed the chi-square gate.
  int tags_added{};     ///< Entered the state with this image.
  int tags_pending{};   ///< Waiting until their pose branch is certain.
  double nis{};         ///< Normalised innovation squared of all used tags together.
  int nis_dof{};
  /// RMS over the used corners after the update, raw pixels; 0: none.
  double reprojection_px{};
  int tags_dropped{};  ///< Removed from the state after repeated contradictions (moved or wrong).
  std::array<int, kMostNamed> dropped_tags{};    ///< Ids of the first ones.
  int tags_fitting{};                            ///< Used at the map's poses.
  std::array<int, kMostFitting> fitting_tags{};  ///< Ids of the first ones.
  /// Residual of a tag's corners after the update.
  struct CornerFit {
    int tag_id{};
    double rms_px{};  ///< Raw pixels.
  };
  int tags_measured{};  ///< Tags with a known pose before the camera, used or not; 0: none used.
  std::array<CornerFit, kMostFitting> corner_fits{};  ///< Of the first ones.
  int landmarks_used{};  ///< Tracked image points whose track ended with this image.
  int landmarks_rejected{};
  double landmark_nis{};  ///< Normalised innovation squared of the used ones together.
  int landmark_nis_dof{};
  bool running{};        ///< The filter has started.
  bool start_changed{};  ///< Another start hypothesis has taken over: earlier results are void.
  bool start_is_open{};  ///< The start may still be replaced: its results must not be published.
  /// Relocalisation has begun after a long series of contradicting images.
  bool relocalised{};
  /// A known tag contradicts: either it was moved or the body is at another place. Until another
  /// tag decides, the estimate's covariance includes both places.
  struct AmbiguousPlace {
    int tag_id{};   ///< One of those tags.
    double by_m{};  ///< Distance between the two places.
  };
  std::optional<AmbiguousPlace> ambiguous_place;
  /// A single tag determined the place of a lost body: a moved tag or the wrong branch of its pose
  /// would give the same result.
  bool relocalised_by_one_tag{};
  /// Number of complete restarts. Poses of different generations share no axes unless both are
  /// anchored.
  int generation{};
  /// A detected jump of a camera's clock.
  struct ClockJump {
    int camera{};
    double shift_s{};   ///< To be added to its stamps from now on, beyond the configured shift.
    double change_s{};  ///< Change of that shift.
  };
  std::optional<ClockJump> clock_jump;
  /// Set when W was redefined (first reference or known tag): earlier poses of this generation
  /// become X_new = *gauge_shift * X_old.
  std::optional<Pose> gauge_shift;
  /// Set when the map changed and the body moved with it: its pose X_WB became *map_shift * X_WB in
  /// the same workspace.
  std::optional<Pose> map_shift;

  [[nodiscard]] std::span<const int> named_dropped() const {
    return first_of(dropped_tags, tags_dropped);
  }
  [[nodiscard]] std::span<const int> named_fitting() const {
    return first_of(fitting_tags, tags_fitting);
  }
  [[nodiscard]] std::span<const CornerFit> named_fits() const {
    return first_of(corner_fits, tags_measured);
  }
  void name_fit(const CornerFit& fit) { name(fit, corner_fits, tags_measured); }
  void name_fitting(int tag_id) { name(tag_id, fitting_tags, tags_fitting); }
  void name_dropped(int tag_id) { name(tag_id, dropped_tags, tags_dropped); }
  /// Copies tags, NIS and residual of a correction.
  void take_correction(const UpdateReport& done) {
    tags_used = done.tags_used;
    tags_rejected = done.tags_rejected;
    nis = done.nis;
    nis_dof = done.nis_dof;
    reprojection_px = done.reprojection_px;
  }

 private:
  template <class T, std::size_t N>
  static std::span<const T> first_of(const std::array<T, N>& list, int count) {
    return std::span<const T>(list).first(std::min(N, static_cast<std::size_t>(count)));
  }
  template <class T, std::size_t N>
  static void name(const T& one, std::array<T, N>& list, int& count) {
    if (static_cast<std::size_t>(count) < N) list[static_cast<std::size_t>(count)] = one;
    ++count;
  }
};

}  // namespace fiducap
