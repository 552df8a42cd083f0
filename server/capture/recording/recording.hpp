#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/odometry.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

class RecordingLayout;

/// A tag with a given pose (`tags.yaml` known_tags).
struct RecordedTag {
  int tag_id{};                 ///< Number of the tag in its family.
  double edge_m{};              ///< Edge of the black square.
  Pose X_WT;                    ///< Pose of the tag.
  double position_sigma_m{};    ///< Of X_WT, per axis.
  double rotation_sigma_rad{};  ///< Of X_WT, per axis.
};

template <class V>
void describe(V& v, RecordedTag& c) {
  v.value("tag_id", c.tag_id);
  v.value("edge_m", c.edge_m);
  v.value("X_WT", c.X_WT);
  v.value("position_sigma_m", c.position_sigma_m);
  v.value("rotation_sigma_rad", c.rotation_sigma_rad);
}

/// Calibration and tags of a recording in the EuRoC/ASL folder layout with detections; no samples.
struct RecordingInfo {
  std::string folder;
  std::string name;  ///< Last part of the folder.
  std::vector<CameraMount> cameras;
  std::vector<bool> has_images;   ///< Per camera: cam<K>/data/<ns>.png …
  std::vector<bool> has_corners;  ///< … or tags<K>/data.csv.
  std::optional<ImuNoise> imu;
  std::optional<double> gravity_m_s2;  ///< Where it was made; nullopt: not known.
  Pose X_BI;  ///< IMU in body axes (imu0 T_BS); samples are read in body axes.
  std::string tag_family{"tag36h11"};
  double tag_size_m{0.16};
  std::map<int, double> tag_sizes_m;
  std::vector<int> ignore_tags;
  std::optional<int> max_hamming;
  std::optional<int> reference_tag;
  std::vector<RecordedTag> known_tags;
  /// Of recordings without IMU; used by offline solutions only.
  std::shared_ptr<const Odometry> odometry{};
};

/// True state of the body, if recorded (`state_groundtruth_estimate0`).
struct TruthSample {
  Instant at{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
};

/// @param faults  of the files that cannot be used, each with its path: a camera among them has the
/// size 0, noise and tags are those of no file
[[nodiscard]] RecordingInfo read_recording_parts(const RecordingLayout& layout,
                                                 std::vector<Error>& faults);
/// @return Error naming the file and what is missing or broken in it.
[[nodiscard]] Expected<RecordingInfo> read_recording_info(const std::string& folder);

// The YAML files that read_recording_info reads, as text.
[[nodiscard]] std::string camera_yaml(const CameraMount& mount);
[[nodiscard]] std::string imu_yaml(const RecordingInfo& info);
[[nodiscard]] std::string tags_yaml(const RecordingInfo& info);
[[nodiscard]] std::string extrinsics_yaml(const std::vector<Pose>& X_BV);

/// `mav0/odom0` (stamp, pose; T_BS and noises in sensor.yaml), or `vio_odom.csv` of a phone.
[[nodiscard]] Expected<std::optional<Odometry>> read_odometry(const RecordingLayout& layout);
/// By time, without lines that go backwards: the state's estimate, else motion capture's poses of
/// the body (`mocap0`, `vicon0`; T_BS in sensor.yaml). Empty when the recording has none.
[[nodiscard]] Expected<std::vector<TruthSample>> read_truth(const std::string& folder);
[[nodiscard]] Expected<std::vector<TruthSample>> read_truth(const RecordingLayout& layout);
/// `truth/reference_poses.csv` of another program: velocity and biases zero. Empty: there is none.
[[nodiscard]] Expected<std::vector<TruthSample>> read_reference_poses(const std::string& folder);
/// `truth/tags.csv` (id,size,px,py,pz,qw,qx,qy,qz). Empty when there is none. Sigmas are zero.
[[nodiscard]] Expected<std::vector<RecordedTag>> read_truth_tags(const std::string& folder);
/// `truth/extrinsics.yaml`, one X_BV per camera in order. Empty when there is none.
[[nodiscard]] Expected<std::vector<Pose>> read_truth_extrinsics(const std::string& folder);

/// A folder in the EuRoC/ASL layout, played at its own pace.
struct RecordingSourceConfig {
  std::string folder;  ///< Of the recording.
  bool loop{false};    ///< Start again at the end.
  double speed{1.0};   ///< 2: twice as fast as it was recorded.
};

template <class V>
void describe(V& v, RecordingSourceConfig& c) {
  v.path("folder", c.folder);
  v.value("loop", c.loop);
  v.value("speed", c.speed);
}

[[nodiscard]] std::vector<ConfigError> check_source(const RecordingSourceConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

struct RecordingPlayback {
  bool paced{false};  ///< Stamps are moved to the server's clock, samples come when due.
  bool loop{false};
  double speed{1.0};  ///< With `paced`.
};

/// Streams IMU, images, corners by time, in bounded memory, without damaged or incomplete lines.
[[nodiscard]] OpenedSource open_recording(const RecordingInfo& info,
                                          const RecordingPlayback& playback, const Clock& clock);

}  // namespace fiducap
