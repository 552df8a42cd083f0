#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/odometry.hpp"
#include "capture/sensor_source.hpp"
#include "capture/source_surroundings.hpp"

namespace fiducap {

/// A tag whose pose belongs to the recording's problem (`tags.yaml` known_tags).
struct RecordedTag {
  int tag_id{};
  double edge_m{};
  Pose X_WT;
  double position_sigma_m{};
  double rotation_sigma_rad{};
};

template <class V>
void describe(V& v, RecordedTag& c) {
  v.value("tag_id", c.tag_id);
  v.value("edge_m", c.edge_m);
  v.value("X_WT", c.X_WT);
  v.value("position_sigma_m", c.position_sigma_m);
  v.value("rotation_sigma_rad", c.rotation_sigma_rad);
}

/// What a recording says about itself: calibration and tags, no samples. The EuRoC/ASL folder
/// layout with detections.
struct RecordingInfo {
  std::string folder;
  std::string name;  ///< Last part of the folder.
  std::vector<CameraMount> cameras;
  std::vector<bool> has_images;   ///< Per camera: cam<K>/data/<ns>.png …
  std::vector<bool> has_corners;  ///< … or tags<K>/data.csv.
  std::optional<ImuNoise> imu;
  std::optional<double> gravity_m_s2;  ///< Where it was made; nullopt: not told.
  Pose X_BI;  ///< IMU in body axes (imu0 T_BS); samples come out in body axes.
  std::string tag_family{"tag36h11"};
  double tag_size_m{0.16};
  std::map<int, double> tag_sizes_m;
  std::vector<int> ignore_tags;
  std::optional<int> max_hamming;
  std::optional<int> reference_tag;
  std::vector<RecordedTag> known_tags;
  /// Another program's, all of it, where there is no IMU: only what is solved for offline uses it.
  std::shared_ptr<const Odometry> odometry{};
};

/// True state of the body, where the recording has it (`state_groundtruth_estimate0`).
struct TruthSample {
  Instant at{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
};

/// @return Error naming the file and what is missing or broken in it.
[[nodiscard]] Expected<RecordingInfo> read_recording_info(const std::string& folder);
/// `mav0/odom0` (stamp, pose; T_BS and noises in sensor.yaml), or `vio_odom.csv` of a phone.
[[nodiscard]] Expected<std::optional<Odometry>> read_odometry(const std::string& folder);
/// By time; lines that go backwards are left out. Empty when the recording has none.
[[nodiscard]] Expected<std::vector<TruthSample>> read_truth(const std::string& folder);
/// `truth/reference_poses.csv`: another program's answer (velocity and biases zero). Empty when
/// there is none.
[[nodiscard]] Expected<std::vector<TruthSample>> read_reference_poses(const std::string& folder);
/// `truth/tags.csv` (id,size,px,py,pz,qw,qx,qy,qz). Empty when there is none. Sigmas are zero.
[[nodiscard]] Expected<std::vector<RecordedTag>> read_truth_tags(const std::string& folder);
/// `truth/extrinsics.yaml`, one X_BV per camera in order. Empty when there is none.
[[nodiscard]] Expected<std::vector<Pose>> read_truth_extrinsics(const std::string& folder);

/// A folder in the EuRoC/ASL layout, played at its own pace.
struct RecordingSourceConfig {
  std::string folder;
  bool loop{false};
  double speed{1.0};
};

/// Keys of a configuration, see daemon/config/config_schema.hpp.
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
  bool paced{
      false};  ///< True: stamps are moved to the server's clock and samples come when they are due.
  bool loop{false};
  double speed{1.0};  ///< With `paced`.
};

/// Streams IMU, images and corners merged by time. Damaged lines are counted in a log line and left
/// out; a file that ends in the middle of a line gives all lines before it. Reads as it goes,
/// memory does not grow with the recording.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_recording(
    const RecordingInfo& info, const RecordingPlayback& playback, const Clock& clock);

}  // namespace fiducap
