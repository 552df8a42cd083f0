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

/// Where the blocks of BodyEstimate::covariance stand.
namespace estimate_block {
inline constexpr int kPosition = 0;  ///< p_WB, m, W axes.
inline constexpr int kAttitude = 3;  ///< rotation vector in W axes: q_WB = exp(δ) q̂_WB.
inline constexpr int kVelocity = 6;  ///< v_WB, m/s, W axes.
inline constexpr int kBiasF = 9;     ///< accelerometer bias, m/s², B axes.
inline constexpr int kBiasW = 12;  ///< gyro bias, rad/s, B axes (without IMU: minus the body rate).
}  // namespace estimate_block

/// The state of one body at one instant, mean and covariance.
struct BodyEstimate {
  Instant at{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};    ///< Velocity of B's origin, W axes, m/s.
  Eigen::Vector3d w_WB_B{Eigen::Vector3d::Zero()};  ///< Body rate, B axes, rad/s, bias removed.
  Eigen::Vector3d a_WB{
      Eigen::Vector3d::Zero()};  ///< Coordinate acceleration, W axes, m/s² (at rest 0).
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  Matrix15d covariance{Matrix15d::Zero()};
  double gravity_offset_m_s2{};  ///< How much more it is than BodySensors says.
  bool anchored{};  ///< W is the workspace. False: W is wherever this filter happened to start.
};

/// Where the body is, W axes.
struct BodyPlace {
  Eigen::Vector3d p_WB{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Zero()};

  /// 1-sigma, of all three axes together.
  [[nodiscard]] double sigma_m() const { return std::sqrt(covariance.trace()); }
};

/// What one update did. A rejected tag is a value, not a log line and not an exception.
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
  double
      reprojection_px{};  ///< RMS over the used corners after the update, raw pixels; 0 when none.
  int tags_dropped{};     ///< Left the state because they kept contradicting the others (moved or
                          ///< wrong).
  std::array<int, kMostNamed> dropped_tags{};    ///< The ids of the first of them.
  int tags_fitting{};                            ///< Used where the map has them …
  std::array<int, kMostFitting> fitting_tags{};  ///< … the first of them.
  /// How far the corners of a tag were from where the estimate has them after the update.
  struct CornerFit {
    int tag_id{};
    double rms_px{};  ///< Raw pixels.
  };
  int tags_measured{};  ///< Before the camera and with a place, used or not; 0 when none was used …
  std::array<CornerFit, kMostFitting> corner_fits{};  ///< … the first of them.
  int landmarks_used{};  ///< Followed image points whose track ended with this image.
  int landmarks_rejected{};
  double landmark_nis{};  ///< Normalised innovation squared of the used ones together.
  int landmark_nis_dof{};
  bool running{};        ///< The filter has started.
  bool start_changed{};  ///< Another start has won: what followed from the one before is void.
  bool start_is_open{};  ///< The start may still be taken back; what follows from it may not be
                         ///< told.
  /// Images contradicted so long that the body is looked for anew in what was learned.
  bool relocalised{};
  /// All known tags in view contradict: they were moved, or the body is elsewhere. Until another
  /// one decides, the estimate's covariance reaches that far.
  struct Elsewhere {
    int tag_id{};   ///< One of those tags.
    double by_m{};  ///< Where they want the body, from where it is thought to be.
  };
  std::optional<Elsewhere> elsewhere;
  /// One tag alone said where a body is that did not know it: a moved tag, or its other branch,
  /// would say so, too.
  bool returned_alone{};
  /// How often the filter has forgotten everything. Poses of different generations share no axes
  /// unless both are anchored.
  int generation{};
  /// A camera's clock that was found to have jumped.
  struct ClockJump {
    int camera{};
    double shift_s{};   ///< To be added to its stamps from now on, beyond what is configured …
    double change_s{};  ///< … and by how much that has changed.
  };
  std::optional<ClockJump> clock_jump;
  /// Set when W was re-defined (first reference or known tag): poses of this generation given out
  /// before are X_new = *gauge_shift * X_old.
  std::optional<Pose> gauge_shift;
  /// Set when the map has learned, and the body went along: it stood at X_WB, where it is now said
  /// to have stood at *map_shift * X_WB. The room is the same as before.
  std::optional<Pose> map_shift;

  [[nodiscard]] std::span<const int> named_dropped() const {
    return std::span(dropped_tags)
        .first(std::min(kMostNamed, static_cast<std::size_t>(tags_dropped)));
  }
  [[nodiscard]] std::span<const int> named_fitting() const {
    return std::span(fitting_tags)
        .first(std::min(kMostFitting, static_cast<std::size_t>(tags_fitting)));
  }
  [[nodiscard]] std::span<const CornerFit> named_fits() const {
    return std::span(corner_fits)
        .first(std::min(kMostFitting, static_cast<std::size_t>(tags_measured)));
  }
  void name_fit(const CornerFit& fit) {
    if (static_cast<std::size_t>(tags_measured) < kMostFitting)
      corner_fits[static_cast<std::size_t>(tags_measured)] = fit;
    ++tags_measured;
  }
  void name_fitting(int tag_id) {
    if (static_cast<std::size_t>(tags_fitting) < kMostFitting)
      fitting_tags[static_cast<std::size_t>(tags_fitting)] = tag_id;
    ++tags_fitting;
  }
  void name_dropped(int tag_id) {
    if (static_cast<std::size_t>(tags_dropped) < kMostNamed)
      dropped_tags[static_cast<std::size_t>(tags_dropped)] = tag_id;
    ++tags_dropped;
  }
};

}  // namespace fiducap
