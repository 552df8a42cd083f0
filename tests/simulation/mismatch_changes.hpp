#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "simulation/estimation_data.hpp"

// Changes of simulated samples or of the configuration that make them disagree.
namespace fiducap::mismatch {

/// Every image with its number and its time since the first sample.
void for_images(EstimationData& data,
                const std::function<void(CornerFrame&, std::size_t k, double t_s)>& work);
/// Seconds from the first sample to the last.
[[nodiscard]] double length_s(const EstimationData& data);
/// At most `count` tags that are seen most, without the reference.
[[nodiscard]] std::vector<int> often_seen(const EstimationData& data, std::size_t count);

void shift_stamps(EstimationData& data, double from_s, double by_s);
void jitter_stamps(EstimationData& data, double sigma_s, std::uint64_t seed);
/// Tags are larger than configured. @param only  nullopt: all
void print_larger(EstimationData& data, double factor, std::optional<int> only = {});
void lengthen_told_lens(EstimationData& data, double factor);
void move_told_centre(EstimationData& data, const Eigen::Vector2d& by_px);
/// The lens has more distortion than configured, by these first two coefficients.
void bend_images(EstimationData& data, double k1, double k2 = 0);
/// No tags in [k · every, k · every + length), k > 0.
void blind(EstimationData& data, double every_s, double length_s);
void show_no_tag(EstimationData& data);
void drop_every(EstimationData& data, std::size_t nth);
/// The gyro's range ends at a share of the largest rate of the run.
void clip_gyro(EstimationData& data, double share);
void swap_imu_axes(EstimationData& data);
void turn_told_camera(EstimationData& data, double angle_rad);
/// From a time on each of the two tags is reported with the other one's id.
void swap_ids(EstimationData& data, int a, int b, double from_s);
/// Moves the tag from a time on. @param key  of its noise
void carry(EstimationData& data, int tag_id, double from_s,
           const std::function<Pose(double t_s)>& X_WT, std::uint64_t key);
/// Where a tag on a door hangs. @param share  0: closed, in its place … 1: open by 60°
[[nodiscard]] Pose opened(const Pose& X_WT, double share);
/// A tag on a hinge beside it, that opens and closes from a time on.
void hang_on_door(EstimationData& data, int tag_id, double from_s, std::uint64_t seed);
/// A second print of an id hangs elsewhere, where it is often seen.
void print_again(EstimationData& data, int tag_id, std::uint64_t seed);
/// A second print of an id of the room.
void show_beside(EstimationData& data, const RecordedTag& print, std::uint64_t seed);
/// Moving corners smear: they scatter along their way, and tags that smear too much are not read.
void blur(EstimationData& data, double exposure_s, std::uint64_t seed);

/// The tag that comes into view next after the first second; when all are there by then, the one
/// that does so last.
[[nodiscard]] int late_tag(const EstimationData& data);
/// One that is there at once is seen only from between 1.1 and 2.6 s on.
void hide_at_first(EstimationData& data, int tag_id, std::uint64_t seed);
/// In one or two images of the first second another tag is read as this one.
void misread_as(EstimationData& data, int tag_id, std::uint64_t seed);

}  // namespace fiducap::mismatch
