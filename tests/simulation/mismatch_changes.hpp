#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "mapping/tag_map.hpp"
#include "simulation/estimation_data.hpp"

// Changes of simulated samples or of the configuration that make them disagree.
namespace fiducap::mismatch {

/// Calls `work` with every image, its number and its time since the first sample.
void for_images(EstimationData& data,
                const std::function<void(CornerFrame&, std::size_t k, double t_s)>& work);
void for_imu(EstimationData& data, const std::function<void(ImuSample&)>& work);
/// Pose of the camera at an instant of the IMU's clock.
[[nodiscard]] Pose camera_at(const EstimationData& data, Instant at);
[[nodiscard]] Eigen::Vector3d random_axis(std::uint64_t seed);
/// Seconds from the first sample to the last.
[[nodiscard]] double length_s(const EstimationData& data);
/// The tags seen most, at most `count`, without the reference.
[[nodiscard]] std::vector<int> often_seen(const EstimationData& data, std::size_t count);

void shift_stamps(EstimationData& data, double from_s, double by_s);
void jitter_stamps(EstimationData& data, double sigma_s, std::uint64_t seed);
/// Tags are larger than configured. @param only  nullopt: all
void print_larger(EstimationData& data, double factor, std::optional<int> only = {});
void lengthen_configured_lens(EstimationData& data, double factor);
void move_configured_centre(EstimationData& data, const Eigen::Vector2d& by_px);
/// The lens has more distortion than configured, by these first two coefficients.
void bend_images(EstimationData& data, double k1, double k2 = 0);
/// No tags in [k · every, k · every + length), k > 0.
void blind(EstimationData& data, double every_s, double length_s);
void show_no_tag(EstimationData& data);
/// Hides all tags for five seconds, in which one is moved, and shows it alone for five more. Tag
/// and instant are those at which the moved tag is then seen most.
void show_moved_tag_alone(EstimationData& data, const Eigen::Vector3d& by_m, std::uint64_t seed);
/// A share of all corners has this noise instead.
void scatter_corners(EstimationData& data, double share, double sigma_px, std::uint64_t seed);
/// Left and right are exchanged; corners in the order in which a detector would report them.
void mirror_images(EstimationData& data);
void drop_every(EstimationData& data, std::size_t nth);
/// Limits the gyro to a share of the largest rate of the run.
void clip_gyro(EstimationData& data, double share);
void swap_imu_axes(EstimationData& data);
/// The bias of the gyro's z axis grows.
void drift_gyro(EstimationData& data, double rad_s2);
/// The room and all in it go up in a lift: 0.5 m/s² for 2 s, even for 3 s, −0.5 m/s² for 2 s.
void take_lift(EstimationData& data, double from_s);
/// No samples for eight seconds, after which the body is about 2 m away and turned.
void carry_asleep(EstimationData& data, double from_s);
void turn_configured_camera(EstimationData& data, double angle_rad);
/// The configured pose of the camera is off in a random direction, and exact by its sigmas.
void displace_configured_camera(EstimationData& data, double by_m, double by_rad,
                                std::uint64_t seed);
/// Exchanges the ids of two tags from a time on.
void swap_ids(EstimationData& data, int a, int b, double from_s);
/// Moves the tag from a time on. @param key  of its noise
void carry(EstimationData& data, int tag_id, double from_s,
           const std::function<Pose(double t_s)>& X_WT, std::uint64_t key);
/// Pose of a tag on a door. @param share  0: closed … 1: open by 60°
[[nodiscard]] Pose opened(const Pose& X_WT, double share);
/// Puts the tag on a door that opens and closes from a time on.
void hang_on_door(EstimationData& data, int tag_id, double from_s, std::uint64_t seed);
/// Adds a second print of an id at another place, where it is often seen.
void print_again(EstimationData& data, int tag_id, std::uint64_t seed);
/// Adds a second print of an id of the room.
void show_beside(EstimationData& data, const RecordedTag& print, std::uint64_t seed);
/// Motion blur: corners scatter along their motion, and tags with too much blur are not read.
void blur(EstimationData& data, double exposure_s, std::uint64_t seed);

/// The map of the room as a good one is kept: errors of 2 mm and 2 mrad.
[[nodiscard]] TagMap kept_map(const EstimationData& data, std::uint64_t seed);
/// … after which all tags but the reference were moved by 0.3 m and 10°.
[[nodiscard]] TagMap map_before_moves(const EstimationData& data, std::uint64_t seed);
/// A room in which other tags are at these places.
[[nodiscard]] TagMap map_of_another_room(const EstimationData& data, std::uint64_t seed);

/// The tag that comes into view next after the first second; if there is none, the last one before.
[[nodiscard]] int late_tag(const EstimationData& data);
/// Hides a tag of the first second until an instant between 1.1 and 2.6 s.
void hide_at_first(EstimationData& data, int tag_id, std::uint64_t seed);
/// Another tag is read as this one in one or two images of the first second.
void misread_as(EstimationData& data, int tag_id, std::uint64_t seed);

}  // namespace fiducap::mismatch
