#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/gravity.hpp"
#include "base/time.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"

/// Simulated rooms and robots: configuration, true motion, sensor source.
namespace fiducap::simulation {

/// A box (W axes) with more light than the rest of the room.
struct DaylightConfig {
  double factor{1.0};  ///< Light in the box, relative to the rest; 1: even light.
  Eigen::Vector3d low{Eigen::Vector3d::Zero()};   ///< Corner with the smallest x, y, z, m.
  Eigen::Vector3d high{Eigen::Vector3d::Zero()};  ///< Corner with the largest x, y, z, m.
};

/// Round trip of preset `ring`: a rounded rectangle with a height change, tags on its outside.
struct RingConfig {
  double length_m{92.0};  ///< At least 60.
  int tags{100};          ///< Number of tags.
};

/// The room: tags on its walls, floor, ceiling or tables.
struct RoomConfig {
  /// `hall`: 24 tags on four walls; `table` `sparse` `loop` `ceiling`: the classes of data/;
  /// `pavillon`: a loop of 80 m with 33 tags; `ring`: a loop by `ring`; `custom`: `tags` only.
  std::string preset{"hall"};
  std::string family{"tag36h11"};  ///< Of the room's tags.
  double tag_size_m{0.4};  ///< Of `hall`, and of `tags` with edge 0; other presets have their own.
  std::vector<RecordedTag> tags;            ///< Added to those of the preset; an equal id replaces.
  double gravity_m_s2{kUsualGravity_m_s2};  ///< Of the room.
  RingConfig ring;
  DaylightConfig daylight;
  /// Of walls, floor and ceiling: `clutter`, a little out of focus (fast); `sharp`, the same in
  /// focus with fine grain, to track image points (about 10 ms more per image); `plain`.
  std::string texture{"clutter"};
};

/// How one robot moves. Smooth in position and attitude up to the third derivative.
struct TrajectoryConfig {
  /// `survey`: walks along the walls and looks at them; `hover`; `table` `sparse` `loop` `ceiling`:
  /// the classes of data/ (`loop`: the round trip of its room); `file`: recorded poses.
  std::string kind{"survey"};
  std::string file;      ///< CSV or TUM poses for kind `file`, fitted by a spline.
  double duration_s{0};  ///< 0: unlimited (the motion repeats smoothly).
  double speed{1.0};     ///< Scales time.
  double from{0};        ///< Of kind `loop`: start on the round trip, 0 … 1.
  double share{1};  ///< Of kind `loop`: share of the round trip; less than 1 goes back and forth.
  std::uint64_t seed{1};  ///< Of the motion's random numbers.
};

/// Errors of the IMU. Densities as in `bodies[].imu`.
struct ImuErrors {
  ImuNoise noise{1.22173e-4, 2e-5, 2.3e-3, 5e-4, 200.0};
  Eigen::Vector3d gyro_bias{0.006, -0.004, 0.005};  ///< At the start, rad/s.
  Eigen::Vector3d accel_bias{0.05, -0.04, 0.06};    ///< At the start, m/s².
  double scale_error{0.0};                          ///< 1-sigma of each axis' scale, both sensors.
  double misalignment_rad{0.0};                     ///< 1-sigma of each axis' tilt, both sensors.
  // Known parts of both, before the drawn ones; not in the configuration.
  Eigen::Matrix3d gyro_gain{Eigen::Matrix3d::Identity()};
  Eigen::Matrix3d accel_gain{Eigen::Matrix3d::Identity()};
  double gyro_range_rad_s{35.0};   ///< Saturation.
  double accel_range_m_s2{160.0};  ///< Saturation.
};

/// Images, or corners without images, of a camera.
struct CameraSimulation {
  bool images{true};              ///< False: noisy corners, a thousand times cheaper.
  double corner_noise_px{0.4};    ///< Corners only.
  double exposure_s{0.005};       ///< Motion blur. In daylight the automatic exposure shortens it.
  double exposure_lag_s{0.4};     ///< Time constant of the automatic exposure.
  double pixel_noise{3.0};        ///< 1-sigma, of 255.
  double vignetting{0.3};         ///< Darkening in the image corner, 0..1.
  double min_side_px{16.0};       ///< Corners only: least side of a tag.
  double max_tilt_rad{1.2566};    ///< Corners only: largest angle off a tag's normal (72°).
  double miss_probability{0.02};  ///< Corners only: share of the other tags that is missed.
  double latency_s{0.01};         ///< Mid-exposure → delivery, when paced.
};

/// Injected faults, with a probability per sample or at a time.
struct FaultConfig {
  double drop_image{0};     ///< Share of images that are lost.
  double drop_imu{0};       ///< Share of IMU samples that are lost.
  double delay_image_s{0};  ///< Additional constant delay of images.
  double jitter_s{0};       ///< 1-sigma of stamp-preserving arrival jitter.
  double occlude{0};        ///< Share of hidden tags, per image.
  /// Corners only: share of tags with a covered corner, per image; it is reported further in, by at
  /// most a border width (edge / 8) along each side.
  double occlude_corner{0};
  double wrong_id{0};          ///< Share of tags reported (or printed) with another id, per image.
  double blackout_every_s{0};  ///< No image for `blackout_s` each time.
  double blackout_s{0};        ///< Duration of a blackout.
  int moved_tag{-1};           ///< Id of a tag that jumps.
  double moved_at_s{0};        ///< Time of the jump.
  Eigen::Vector3d moved_by_m{Eigen::Vector3d::Zero()};  ///< W axes.
  double image_stamp_error_s{0};     ///< Stamp minus exposure: camera–IMU time offset.
  double imu_stamp_jitter_s{0};      ///< 1-sigma of IMU stamps; clamped so that their order stays.
  double saturation_at_s{0};         ///< Begin of an interval in which the IMU saturates early.
  double saturation_s{0};            ///< Its length.
  double saturated_gyro_rad_s{0.4};  ///< Limit per axis in this interval.
  double saturated_accel_m_s2{9.5};  ///< Limit per axis in this interval.
};

/// One simulated robot in a room.
struct SimulatedBodyConfig {
  std::vector<CameraMount> cameras;  ///< *True* calibration, used by the renderer.
  bool has_imu{true};
  ImuErrors imu;
  CameraSimulation camera;
  TrajectoryConfig trajectory;
  FaultConfig faults;
  std::uint64_t seed{1};  ///< Of the sensors' random numbers.
};

[[nodiscard]] std::vector<ConfigError> check(const RoomConfig& room, const std::string& prefix);
[[nodiscard]] std::vector<ConfigError> check(const SimulatedBodyConfig& body,
                                             const std::string& prefix);

/// Checks the robot and its combination with the other sources of its body.
[[nodiscard]] std::vector<ConfigError> check_source(const SimulatedBodyConfig& robot,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

/// The true tags of the room, sorted by id.
[[nodiscard]] std::vector<RecordedTag> tags_of(const RoomConfig& room);

/// The true motion of a robot: position, attitude and their derivatives at any time since start.
class Trajectory {
 public:
  struct Point {
    Pose X_WB;
    Eigen::Vector3d v_WB;    ///< m/s, W axes
    Eigen::Vector3d a_WB;    ///< m/s², W axes
    Eigen::Vector3d w_WB_B;  ///< rad/s, B axes
  };
  virtual ~Trajectory() = default;
  [[nodiscard]] virtual Point at(double t_s) const = 0;
};

/// Camera axes of a camera that looks along the body's x axis, image top along its z axis.
[[nodiscard]] Pose forward_camera();

/// @param X_BV  nominal pose of the camera whose view the motion is planned for
[[nodiscard]] Expected<std::unique_ptr<Trajectory>> make_trajectory(
    const TrajectoryConfig& config, const RoomConfig& room, const Pose& X_BV = forward_camera());

/// A source with ground truth. The samples depend on the configuration only, not on the pace.
class SimulatedSource : public SensorSource {
 public:
  /// The true state at any instant of the source's time line. Thread-safe.
  [[nodiscard]] virtual TruthSample truth(Instant at) const = 0;
  [[nodiscard]] virtual Instant start() const = 0;
  /// True calibration of the cameras.
  [[nodiscard]] virtual const std::vector<CameraMount>& cameras() const = 0;
};

/// @param start   stamp of t = 0
/// @param clock   samples arrive when they are due on this clock; nullptr: as fast as requested
/// @param motion  replaces the configured trajectory, unless nullptr
[[nodiscard]] Expected<std::unique_ptr<SimulatedSource>> make_simulated_source(
    const RoomConfig& room, const SimulatedBodyConfig& body, Instant start, const Clock* clock,
    std::unique_ptr<Trajectory> motion = nullptr);

}  // namespace fiducap::simulation
