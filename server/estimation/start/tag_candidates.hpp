#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/estimator_config.hpp"

namespace fiducap {

/// Attitude of the body while it has no pose: rotation by the gyroscope, vertical by the low-pass
/// filtered accelerometer. Tilt is accurate to a few degrees without long acceleration; heading is
/// arbitrary and drifts.
class AttitudeStart final {
 public:
  void add(const ImuSample& imu, const Eigen::Vector3d& bias_w, const Eigen::Vector3d& bias_f);
  void restart() { *this = AttitudeStart{}; }
  /// Enough samples for the vertical.
  [[nodiscard]] bool ready() const { return samples_ >= kNeededSamples; }
  /// Body in fixed axes L, for comparing views. The rate is held after the newest sample.
  [[nodiscard]] Eigen::Quaterniond q_LB(Instant at, const Eigen::Vector3d& bias_w) const;
  /// Body in level axes, heading as in L.
  [[nodiscard]] Eigen::Quaterniond q_WB(Instant at, const Eigen::Vector3d& bias_w) const;

 private:
  static constexpr int kNeededSamples = 10;
  static constexpr double kMemory_s = 0.5;  ///< Time constant of the low-pass filter.

  Eigen::Quaterniond q_LB_{Eigen::Quaterniond::Identity()};
  Eigen::Vector3d f_L_{Eigen::Vector3d::Zero()};
  std::optional<ImuSample> last_;
  int samples_{0};
};

/// Attitude of a camera at a view of a candidate tag.
struct CameraAttitude {
  Eigen::Quaterniond q_WV;  ///< In axes that are fixed over the views.
  double turn_sigma_rad{};  ///< Error of each view, 1-sigma per axis; 0: of a gyro.
};

/// Pose of a tag whose branch is certain.
struct TagVerdict {
  Pose X_VT;  ///< In the camera's axes, by the newest image alone.
  /// Attitude by all views, in the axes of CameraAttitude.
  std::optional<Eigen::Quaterniond> q_WT;
  double cost{};  ///< Chi-square of the views by the assumed corner noise …
  int numbers{};  ///< … and its degrees of freedom; 0: not known.
};

/// Numbers of views of a tag.
struct ViewLimits {
  int at_least{1};      ///< Before a tag is accepted: a phantom id is rarely seen twice.
  int forced_after{0};  ///< A branch is taken without enough evidence after these; 0: never.
};

/// Tags whose pose branch is not certain yet.
///
/// Four coplanar corners allow two poses (branches). The tag is fixed in the room and the gyroscope
/// gives the rotation of the camera between views, so the wrong branch costs more in chi-square; a
/// branch is selected when the other costs `branch_evidence` more. Each view has its own distance,
/// only the tag's attitude is common, so the camera's path is not needed. Old views are dropped: a
/// gyro drifts, and a tag may be moved.
class TagCandidates final {
 public:
  explicit TagCandidates(const EstimatorConfig& config) : config_(config) {}

  /// @param noise_px     1-sigma of this sighting's corners; at least the configured noise, as the
  ///                     remaining errors are common to the views of a tag
  /// @param attitude     nullopt: not known; the evidence of single views is summed
  /// @return nullopt while the branch is not certain
  [[nodiscard]] std::optional<TagVerdict> judge(int camera, Instant at, const TagObservation& seen,
                                                const CameraModel& model, double noise_px,
                                                const std::optional<CameraAttitude>& attitude,
                                                const ViewLimits& limits);
  void forget(int tag_id);
  void forget_all() { candidates_.clear(); }
  [[nodiscard]] std::size_t size() const { return candidates_.size(); }

 private:
  struct View {
    Instant at{};
    TagObservation seen;
    double weight{};  ///< 1/px²
    Eigen::Quaterniond q_WV;
    double turn_sigma_rad{};
    Eigen::Vector3d p_VT;
  };
  struct Branch {
    Eigen::Quaterniond q_WT;
    double cost{};  ///< chi-square over the views
  };
  struct Candidate {
    std::vector<View> views;  ///< With attitude: the newest `branch_views`.
    Instant last_seen{};
    int seen_times{0};
    Eigen::Vector2d counted_px{Eigen::Vector2d::Zero()};  ///< Place in the image …
    int counted_there{0};                                 ///< … and views there.
    double followed_cost{0};  ///< Without attitude: chi-square of the tracked branch …
    double rival_cost{0};     ///< … and of the other.
    Eigen::Quaterniond followed_q_VT{Eigen::Quaterniond::Identity()};
  };
  /// @param turns  false: the attitude is given, only the distances are fitted
  [[nodiscard]] Branch fit(std::vector<View>& views, const CameraModel& model,
                           Eigen::Quaterniond q_WT, bool turns) const;
  [[nodiscard]] std::optional<TagVerdict> judge_turning(Candidate& candidate, View newest,
                                                        const CameraModel& model,
                                                        const std::array<TagPose, 2>& poses,
                                                        bool forced);
  [[nodiscard]] std::optional<TagVerdict> judge_alone(Candidate& candidate, const View& newest,
                                                      const std::array<TagPose, 2>& poses,
                                                      bool forced);

  EstimatorConfig config_;
  std::map<std::pair<int, int>, Candidate> candidates_;  ///< By tag id and camera.
};

}  // namespace fiducap
