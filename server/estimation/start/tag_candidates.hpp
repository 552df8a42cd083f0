#pragma once

#include <map>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_pose.hpp"
#include "estimation/estimator_config.hpp"

namespace fiducap {

/// What is known about the camera while a tag is being judged.
struct CameraAttitude {
  Eigen::Quaterniond q_WV;  ///< In any axes that stand still over the views.
  double turn_sigma_rad{};  ///< How far it may be off in each view, 1-sigma per axis; 0: a gyro's.
};

/// What the views of a tag say once its branch is certain.
struct TagVerdict {
  Pose X_VT;  ///< The tag in the camera's axes, by the newest image alone.
  std::optional<Eigen::Quaterniond>
      q_WT;  ///< Its attitude by all views, in the axes of CameraAttitude.
};

/// When a tag has been looked at long enough.
struct Patience {
  int at_least{1};  ///< Views before a tag is believed at all: a phantom id is rarely seen twice.
  int forced_after{
      0};  ///< A branch is taken without enough evidence after so many views; 0: never.
};

/// Tags that were seen but whose pose branch is not yet certain.
///
/// Four coplanar corners allow two poses. Both are kept; every further view judges them: the tag
/// stands still in the room, the gyro knows how the camera turned, so the wrong branch would need a
/// tag that turns. A branch wins when the other costs more than `branch_evidence` in chi-square.
/// Each view keeps its own distance, only the tag's attitude is shared, so no knowledge of the
/// camera's path is needed. Views age: a gyro drifts, and a tag may be carried off.
class TagCandidates final {
 public:
  explicit TagCandidates(const EstimatorConfig& config) : config_(config) {}

  /// @param noise_px     of this sighting's corners, 1-sigma; at least the configured noise is
  /// reckoned with: what sharp
  ///                     corners leave is shared by the views of a tag, and many of them must not
  ///                     add up to certainty
  /// @param attitude     nullopt: nothing tells how the camera turned; the views' own evidence is
  /// added up
  /// @return nullopt while its branch is not certain
  [[nodiscard]] std::optional<TagVerdict> judge(int camera, Instant at, const TagObservation& seen,
                                                const CameraModel& model, double noise_px,
                                                const std::optional<CameraAttitude>& attitude,
                                                const Patience& patience);
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
    Eigen::Vector2d counted_px{Eigen::Vector2d::Zero()};  ///< Where it was …
    int counted_there{0};                                 ///< … for so many views that count.
    double followed_cost{0};  ///< Without attitude: Σ chi-square of the followed branch …
    double rival_cost{0};     ///< … and of the other.
    Eigen::Quaterniond followed_q_VT{Eigen::Quaterniond::Identity()};
  };
  /// @param turns  false: the attitude is given, only the views' distances are fitted
  [[nodiscard]] Branch fit(std::vector<View>& views, const CameraModel& model,
                           Eigen::Quaterniond q_WT, bool turns) const;
  [[nodiscard]] std::optional<TagVerdict> judge_turning(Candidate& candidate, View newest,
                                                        const CameraModel& model,
                                                        const std::array<TagPose, 2>& poses,
                                                        bool forced);
  void forget_aged(Instant now);
  [[nodiscard]] std::optional<TagVerdict> judge_alone(Candidate& candidate, const View& newest,
                                                      const std::array<TagPose, 2>& poses,
                                                      bool forced);

  EstimatorConfig config_;
  std::map<std::pair<int, int>, Candidate> candidates_;  ///< By tag id and camera.
};

}  // namespace fiducap
