#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "simulation/estimation_data.hpp"

// Changes of simulated samples or of the configuration that make them disagree.
namespace fiducap::mismatch {

/// Calls `work` with every image, its number and its time since the first sample.
void for_images(EstimationData& data,
                const std::function<void(CornerFrame&, std::size_t k, double t_s)>& work);
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
void drop_every(EstimationData& data, std::size_t nth);
/// Limits the gyro to a share of the largest rate of the run.
void clip_gyro(EstimationData& data, double share);
void swap_imu_axes(EstimationData& data);
void turn_configured_camera(EstimationData& data, double angle_rad);
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

/// The tag that comes into view next after the first second; if there is none, the last one before.
[[nodiscard]] int late_tag(const EstimationData& data);
/// Hides a tag of the first second until an instant between 1.1 and 2.6 s.
void hide_at_first(EstimationData& data, int tag_id, std::uint64_t seed);
/// Another tag is read as this one in one or two images of the first second.
void misread_as(EstimationData& data, int tag_id, std::uint64_t seed);

}  // namespace fiducap::mismatch
