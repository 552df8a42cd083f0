#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/gravity.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/recording.hpp"
#include "capture/source_surroundings.hpp"

namespace fiducap::simulation {

/// Where the room is open to the sky: what is inside this box (W axes) gets more light than the
/// rest.
struct DaylightConfig {
  double factor{
      1.0};  ///< So many times the light of the rest; 1: even light, the box does not matter.
  Eigen::Vector3d low{Eigen::Vector3d::Zero()};
  Eigen::Vector3d high{Eigen::Vector3d::Zero()};
};

/// The round trip of preset `ring`: a rounded rectangle with a height change, tags at its outside.
struct RingConfig {
  double length_m{92.0};  ///< At least 60.
  int tags{100};
};

/// The room: tags on its walls, floor, ceiling or tables.
struct RoomConfig {
  std::string preset{
      "hall"};  ///< `hall`: 24 tags on four walls; `table` `sparse` `loop` `ceiling`: the classes
                ///< of data/; `pavillon`: as `loop`, 33 tags on 80 m; `ring`: as
                ///< `loop`, as large as `ring` says; `custom`: `tags` only.
  std::string family{"tag36h11"};
  double tag_size_m{
      0.4};  ///< Of `hall` and of `tags` whose edge is 0; the classes of data/ have their own.
  std::vector<RecordedTag>
      tags;  ///< Added to (or with `custom`: instead of) the preset's; an equal id replaces.
  double gravity_m_s2{kUsualGravity_m_s2};
  RingConfig ring;
  DaylightConfig daylight;
  /// What walls, floor and ceiling show: `clutter` a little out of focus (quick), `sharp` the same
  /// in focus with fine grain on it, for following image points (some 10 ms per image more),
  /// `plain` nothing.
  std::string texture{"clutter"};
};

/// How one robot moves. Smooth in position and attitude up to the third derivative.
struct TrajectoryConfig {
  std::string kind{"survey"};  ///< `survey`: walks the room looking at its walls; `hover`; `table`
                               ///< `sparse` `loop` `ceiling`: the classes of data/ (`loop`: the
                               ///< round trip of its room); `file`: recorded poses.
  std::string file;            ///< CSV or TUM poses for kind `file`, fitted by a spline.
  double duration_s{0};        ///< 0: for ever (the motion repeats smoothly).
  double speed{1.0};           ///< Scales time.
  /// Of the round trip of kind `loop`: where it begins, 0 … 1, and how much of it is walked. Less
  /// than all of it is walked back and forth.
  double from{0};
  double share{1};
  std::uint64_t seed{1};
};

/// What the IMU does wrong. Densities as in ImuNoise.
struct ImuErrors {
  ImuNoise noise{1.22173e-4, 2e-5, 2.3e-3, 5e-4, 200.0};
  Eigen::Vector3d gyro_bias{0.006, -0.004, 0.005};
  Eigen::Vector3d accel_bias{0.05, -0.04, 0.06};
  double scale_error{0.0};        ///< 1-sigma of each axis' scale, both sensors.
  double misalignment_rad{0.0};   ///< 1-sigma of each axis' tilt, both sensors.
  double gyro_range_rad_s{35.0};  ///< Saturation.
  double accel_range_m_s2{160.0};
};

/// What the camera sees and how.
struct CameraSimulation {
  bool images{true};            ///< False: corners with noise, at a thousandth of the cost.
  double corner_noise_px{0.4};  ///< Corners only.
  double exposure_s{0.005};     ///< Motion blur. In daylight the automatic exposure shortens it.
  double exposure_lag_s{
      0.4};  ///< Time constant with which the exposure follows the light where the camera is.
  double pixel_noise{3.0};        ///< 1-sigma, of 255.
  double vignetting{0.3};         ///< Darkening in the image corner, 0..1.
  double min_side_px{16.0};       ///< Corners only: a tag with a shorter side is not reported …
  double max_tilt_rad{1.2566};    ///< … nor one seen further off its normal (72°) …
  double miss_probability{0.02};  ///< … nor this share of the rest.
  double latency_s{0.01};         ///< Mid-exposure → delivery, when paced.
};

/// Faults on demand, each with a probability per sample or a time.
struct FaultConfig {
  double drop_image{0};  ///< Share of images that never arrive.
  double drop_imu{0};
  double delay_image_s{0};  ///< Additional constant delay of images.
  double jitter_s{0};       ///< 1-sigma of stamp-preserving arrival jitter.
  double occlude{0};        ///< Share of tags hidden completely, per image.
  double occlude_corner{
      0};  ///< Corners only: share of tags with one corner covered, per image; it is reported
           ///< further in, by at most a border width (edge / 8) along each side.
  double wrong_id{0};          ///< Share of tags reported (or printed) with another id, per image.
  double blackout_every_s{0};  ///< No image for `blackout_s` each time.
  double blackout_s{0};
  int moved_tag{-1};                                    ///< This tag jumps …
  double moved_at_s{0};                                 ///< … at this time …
  Eigen::Vector3d moved_by_m{Eigen::Vector3d::Zero()};  ///< … by this (W axes).
  double image_stamp_error_s{0};  ///< Images say that they were exposed so much later than they
                                  ///< were (camera–IMU time offset).
  double imu_stamp_jitter_s{
      0};  ///< 1-sigma by which IMU stamps are wrong; cut off before neighbours could change order.
  double saturation_at_s{0};         ///< From here …
  double saturation_s{0};            ///< … for so long the IMU measures no more than …
  double saturated_gyro_rad_s{0.4};  ///< … this per axis …
  double saturated_accel_m_s2{9.5};  ///< … and this.
};

/// One simulated robot in a room.
struct SimulatedBodyConfig {
  std::vector<CameraMount> cameras;  ///< *True* calibration: what the renderer uses.
  bool has_imu{true};
  ImuErrors imu;
  CameraSimulation camera;
  TrajectoryConfig trajectory;
  FaultConfig faults;
  std::uint64_t seed{1};
};

[[nodiscard]] std::vector<ConfigError> check(const RoomConfig& room, const std::string& prefix);
[[nodiscard]] std::vector<ConfigError> check(const SimulatedBodyConfig& body,
                                             const std::string& prefix);

/// Rules of the robot and about the rest of its body.
[[nodiscard]] std::vector<ConfigError> check_source(const SimulatedBodyConfig& robot,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

}  // namespace fiducap::simulation
