#pragma once

#include <vector>

#include "capture/camera_frame.hpp"
#include "detection/tracking/expected_tag.hpp"
#include "estimation/imu/output_predictor.hpp"

namespace fiducap {

/// Says where tags will appear in a body's next image: the newest estimate, carried over the IMU
/// readings since, through the lens.
///
/// The 1-sigma it gives is that of the *relative* pose of camera and tag. For tags that were in the
/// image before, this is the growth of the body's covariance since then and what predictions were
/// off lately (wrong extrinsics, a poor motion model); other tags add the covariances of body and
/// tag, up to a bound: of a long way both know little alone, and much about each other.
///
/// Bounded memory, no allocation after warm-up. Not thread-safe.
class TagForecast final {
 public:
  TagForecast(const BodySensors& sensors, const EstimatorConfig& config);

  void add_imu(const ImuSample& imu) { predictor_.add_imu(imu); }
  /// After every update. An estimate outside of the workspace is as good as none.
  void set_estimate(const BodyEstimate& estimate);
  void clear();
  /// What was learned about a camera.
  void set_camera(std::size_t camera, const ExtrinsicsEstimate& learned) {
    cameras_[camera].mount.X_BV = learned.X_BV;
    cameras_[camera].mount.model = learned.lens.offset.applied_to(cameras_[camera].configured);
  }

  /// Points a camera at what it will see at `at`. @return false when it is not known where the body
  /// is
  bool aim(int camera, Instant at);
  /// How the camera aimed stands then. @pre aim() returned true
  [[nodiscard]] Eigen::Quaterniond q_WV() const { return X_VW_.q.conjugate(); }
  /// Appends the tag if the camera aimed can see it.
  void expect(const KnownTag& tag, std::vector<ExpectedTag>& out) const;
  /// Appends what was found in this camera's last image without being expected, turned as the
  /// camera has turned since: tags that the filter is still making up its mind about, or does not
  /// want.
  void expect_strangers(std::vector<ExpectedTag>& out) const;
  /// What came of the expectations of the camera aimed.
  void learn(const std::vector<ExpectedTag>& expected, const CornerFrame& found);

 private:
  struct Camera {
    CameraMount mount;  ///< As it is known now.
    CameraModel configured;
    double error_px;        ///< Of late: the median over the tags of an image, forgotten slowly.
    std::vector<int> seen;  ///< Ids of the last image, sorted.
    std::vector<TagSighting> strangers;  ///< Of the last image …
    Pose X_VW;                           ///< … and where the camera was then.
  };
  [[nodiscard]] bool was_seen(int tag_id) const;
  [[nodiscard]] double sigma_px(const KnownTag& tag, double depth_m) const;

  OutputPredictor predictor_;
  std::vector<Camera> cameras_;
  std::optional<BodyEstimate> base_;
  std::vector<double> errors_px_;
  Camera* aimed_{nullptr};
  Pose X_VW_;
  double body_position_var_{};  ///< Mean of the axes, at the instant aimed at …
  double body_rotation_var_{};
  double grown_position_var_{};  ///< … and how much of it is new since the newest estimate.
  double grown_rotation_var_{};
};

}  // namespace fiducap
