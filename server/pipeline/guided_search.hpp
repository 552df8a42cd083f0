#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "capture/camera_frame.hpp"
#include "detection/points/point_tracker.hpp"
#include "detection/tag_search.hpp"
#include "estimation/imu/output_predictor.hpp"
#include "estimation/known_tag.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Predicts where tags appear in a body's next image: the newest estimate, propagated by the IMU
/// readings since, projected through the lens.
///
/// The predicted 1-sigma is that of the *relative* pose of camera and tag. For tags of the image
/// before: the growth of the body's covariance since then, and recent prediction errors (wrong
/// extrinsics, poor motion model). Other tags add the covariances of body and tag, up to a bound,
/// because errors of both are correlated far from the origin.
///
/// Bounded memory, no allocation after warm-up. Not thread-safe.
class TagForecast final {
 public:
  TagForecast(const BodySensors& sensors, const EstimatorConfig& config);

  void add_imu(const ImuSample& imu) { predictor_.add_imu(imu); }
  /// After every update. An estimate outside of the workspace counts as none.
  void set_estimate(const BodyEstimate& estimate);
  void clear();
  /// The present estimate of a camera.
  void set_camera(std::size_t camera, const ExtrinsicsEstimate& learned) {
    cameras_[camera].mount.X_BV = learned.X_BV;
    cameras_[camera].mount.model = learned.lens.offset.applied_to(cameras_[camera].configured);
  }

  /// Selects a camera and an instant. @return false while the body's pose is unknown
  bool aim(int camera, Instant at);
  /// Predicted attitude of the selected camera. @pre aim() returned true
  [[nodiscard]] Eigen::Quaterniond q_WV() const { return X_VW_.q.conjugate(); }
  /// Appends the tag if the selected camera can see it.
  void expect(const KnownTag& tag, std::vector<ExpectedTag>& out) const;
  /// Appends tags that this camera's last image showed without a forecast (not in map or state, or
  /// elsewhere), moved by the camera's rotation since.
  void expect_unforecast(std::vector<ExpectedTag>& out) const;
  /// Compares the forecast of the selected camera with the image.
  void learn(const std::vector<ExpectedTag>& expected, const CornerFrame& found);

 private:
  struct Camera {
    CameraMount mount;  ///< As estimated.
    CameraModel configured;
    double error_px;        ///< Recent: median over the tags of an image, decaying slowly.
    std::vector<int> seen;  ///< Ids of the last image, sorted.
    std::vector<TagSighting> unforecast;  ///< Of the last image …
    Pose X_VW;                            ///< … and the camera's pose then.
  };
  [[nodiscard]] bool was_seen(int tag_id) const;
  [[nodiscard]] double sigma_px(const KnownTag& tag, double depth_m) const;

  OutputPredictor predictor_;
  std::vector<Camera> cameras_;
  std::optional<BodyEstimate> base_;
  std::vector<double> errors_px_;
  Camera* aimed_{nullptr};
  Pose X_VW_;
  double body_position_var_{};  ///< Mean of the axes, at the selected instant …
  double body_rotation_var_{};
  double grown_position_var_{};  ///< … and its growth since the newest estimate.
  double grown_rotation_var_{};
};

/// Detects the tags of one body's images where its estimate predicts them: TagForecast and
/// TagSearch; with `estimator.landmarks` it also follows image points (PointTracker). Live and
/// offline runs share it, so a recording gives the same corners again.
class GuidedSearch final {
 public:
  GuidedSearch(const BodySensors& sensors, const TagSetConfig& tags, const DetectorConfig& detector,
               const EstimatorConfig& estimator);

  void add_imu(const ImuSample& imu);
  /// @param local  the tags in the body's own state: they go before the map's
  /// @return see TagSearch
  const CornerFrame& search(const CameraFrame& frame, std::span<const TagBelief> local,
                            const TagMap& map);
  /// Result of the image. @param estimate  the filter's newest one; nullopt: it does not run
  /// @param cameras  estimated cameras; empty: unchanged
  void learn(const std::optional<BodyEstimate>& estimate,
             std::span<const ExtrinsicsEstimate> cameras);

  /// Predicted tags of the last image; empty: all of it was searched.
  [[nodiscard]] std::span<const ExpectedTag> expected() const { return expected_; }
  [[nodiscard]] const SearchStatistics& statistics() const { return search_.statistics(); }

 private:
  void expect(std::span<const TagBelief> local, const TagMap& map);
  const CornerFrame& with_points(const CameraFrame& frame, const CornerFrame& found, bool aimed);

  bool regions_;
  TagSearch search_;
  TagForecast forecast_;
  std::vector<ExpectedTag> expected_;
  std::vector<int> local_ids_;
  std::vector<CameraModel> models_;
  struct PointCamera {
    PointTracker tracker;
    std::optional<Eigen::Quaterniond> q_WV;  ///< At its last image; nullopt: not known.
  };
  std::vector<PointCamera> points_;  ///< Empty: points are not followed.
  CornerFrame with_points_;
};

}  // namespace fiducap
