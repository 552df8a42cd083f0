#include "simulation/sensor_models.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/expected.hpp"
#include "detection/observe.hpp"
#include "simulation/room_shape.hpp"

namespace fiducap::simulation {

namespace {

/// Scale error and misalignment of each axis.
Eigen::Matrix3d gain(Random& random, const ImuErrors& errors) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      m(row, column) +=
          random.normal() * (row == column ? errors.scale_error : errors.misalignment_rad);
  }
  return m;
}

Eigen::Vector3d clamped(const Eigen::Vector3d& x, double range) {
  return x.cwiseMax(-range).cwiseMin(range);
}

// Each step scales the error of the row by the share of the image moved in a readout.
constexpr int kRowSteps = 3;

bool inside(const CameraModel& model, const Eigen::Vector2d& px) {
  return px.x() >= 0 && px.y() >= 0 && px.x() <= model.width - 1 && px.y() <= model.height - 1;
}

/// A rolling shutter exposes a point in the row in which it appears: fixed-point iteration.
std::optional<Eigen::Vector2d> project(const CameraModel& model, const CameraPath& path,
                                       const Pose& X_VW, const Eigen::Vector3d& p_W) {
  auto px = model.project(X_VW * p_W);
  for (int i = 0; i < kRowSteps && px; ++i)
    px = model.project(path(px->y() / (model.height - 1) - 0.5).inverse() * p_W);
  return px;
}

/// The true corners; nullopt when the tag is not visible by the rules.
std::optional<TagCorners> visible_corners(const CameraModel& model, const CameraPath& path,
                                          const Pose& X_WV, const RecordedTag& tag,
                                          const CameraSimulation& rules) {
  const Pose X_VW = X_WV.inverse();
  const Eigen::Vector3d to_camera = X_WV.p - tag.X_WT.p;
  const double cos_tilt = (tag.X_WT.q * Eigen::Vector3d::UnitZ()).dot(to_camera) / to_camera.norm();
  if (!(cos_tilt >= std::cos(rules.max_tilt_rad)) || (X_VW * tag.X_WT.p).z() <= 0)
    return std::nullopt;
  TagCorners corners;
  const auto corners_W = corners_of(tag);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto px = project(model, path, X_VW, corners_W[i]);
    if (!px || !inside(model, *px)) return std::nullopt;
    corners[i] = *px;
  }
  for (std::size_t i = 0; i < corners.size(); ++i)
    if ((corners[(i + 1) % 4] - corners[i]).norm() < rules.min_side_px) return std::nullopt;
  return corners;
}

Random for_image(std::uint64_t seed, Purpose purpose, int camera, std::uint64_t k) {
  return {seed, purpose, static_cast<std::uint64_t>(camera), k};
}

}  // namespace

RandomWalk::RandomWalk(std::uint64_t seed, Purpose purpose) : seed_(seed), purpose_(purpose) {
  constexpr std::uint64_t kEnd = std::uint64_t{1} << kLevels;
  const double sigma = std::sqrt(static_cast<double>(kEnd));
  path_[0] = {0, kEnd, Eigen::Vector3d::Zero(), sigma * Random(seed, purpose, kEnd).normal3()};
}

Eigen::Vector3d RandomWalk::at(std::uint64_t tick) {
  FIDUCAP_ASSERT(tick <= path_[0].high);
  while (depth_ > 0 && (tick < path_[depth_].low || tick > path_[depth_].high)) --depth_;
  for (;;) {
    const Interval& whole = path_[depth_];
    if (tick == whole.low) return whole.at_low;
    if (tick == whole.high) return whole.at_high;
    // Given both ends, the middle is normal about their mean with variance length / 4.
    const std::uint64_t middle = (whole.low + whole.high) / 2;
    const double sigma = 0.5 * std::sqrt(static_cast<double>(whole.high - whole.low));
    const Eigen::Vector3d at_middle =
        0.5 * (whole.at_low + whole.at_high) + sigma * Random(seed_, purpose_, middle).normal3();
    path_[depth_ + 1] = tick < middle ? Interval{whole.low, middle, whole.at_low, at_middle}
                                      : Interval{middle, whole.high, at_middle, whole.at_high};
    ++depth_;
  }
}

ImuModel::ImuModel(const ImuErrors& errors, double gravity_m_s2, std::uint64_t seed)
    : errors_(errors),
      gravity_m_s2_(gravity_m_s2),
      seed_(seed),
      gyro_walk_(seed, Purpose::kGyroWalk),
      accel_walk_(seed, Purpose::kAccelWalk) {
  Random random(seed, Purpose::kImuErrors);
  gyro_gain_ = gain(random, errors) * errors.gyro_gain;
  accel_gain_ = gain(random, errors) * errors.accel_gain;
}

ImuSample ImuModel::measure(std::uint64_t k, const Trajectory::Point& truth) {
  // Densities per √Hz: white noise of one sample is density · √rate, one step of the walk is
  // density / √rate.
  const double root_rate = std::sqrt(errors_.noise.rate_hz);
  const Eigen::Vector3d bias_w =
      errors_.gyro_bias + errors_.noise.gyro_walk_rad_s2_rtHz / root_rate * gyro_walk_.at(k);
  const Eigen::Vector3d bias_f =
      errors_.accel_bias + errors_.noise.accel_walk_m_s3_rtHz / root_rate * accel_walk_.at(k);
  Random random(seed_, Purpose::kImuNoise, k);
  const Eigen::Vector3d noise_w =
      errors_.noise.gyro_noise_rad_s_rtHz * root_rate * random.normal3();
  const Eigen::Vector3d noise_f =
      errors_.noise.accel_noise_m_s2_rtHz * root_rate * random.normal3();
  ImuSample sample;
  sample.w_WB_B = clamped(gyro_gain_ * truth.w_WB_B + bias_w + noise_w, errors_.gyro_range_rad_s);
  sample.f_B = clamped(accel_gain_ * specific_force(truth, gravity_m_s2_) + bias_f + noise_f,
                       errors_.accel_range_m_s2);
  return sample;
}

ImuBias ImuModel::bias_at(double t_s) const {
  const double ticks = std::max(0.0, t_s * errors_.noise.rate_hz);
  const auto k = static_cast<std::uint64_t>(ticks);
  const double share = ticks - static_cast<double>(k);
  const double root_rate = std::sqrt(errors_.noise.rate_hz);
  RandomWalk gyro_walk(seed_, Purpose::kGyroWalk);  // copies: `measure` changes its walks
  RandomWalk accel_walk(seed_, Purpose::kAccelWalk);
  const auto between = [&](RandomWalk& walk) -> Eigen::Vector3d {
    const Eigen::Vector3d before = walk.at(k);
    return before + share * (walk.at(k + 1) - before);
  };
  return {
      errors_.gyro_bias + errors_.noise.gyro_walk_rad_s2_rtHz / root_rate * between(gyro_walk),
      errors_.accel_bias + errors_.noise.accel_walk_m_s3_rtHz / root_rate * between(accel_walk)};
}

void sight_corners(const CameraModel& model, const CameraPath& path,
                   const std::vector<RecordedTag>& tags, const CameraSimulation& rules,
                   const ImageKey& key, std::vector<TagSighting>& out) {
  out.clear();
  const Pose X_WV = path(0);
  Random random(key.seed, Purpose::kCornerNoise, static_cast<std::uint64_t>(key.camera), key.k);
  for (const RecordedTag& tag : tags) {
    const auto corners = visible_corners(model, path, X_WV, tag, rules);
    if (!corners || random.chance(rules.miss_probability)) continue;
    TagSighting sighting;
    sighting.tag_id = tag.tag_id;
    for (std::size_t i = 0; i < corners->size(); ++i) {
      const double du = random.normal();
      const double dv = random.normal();
      sighting.corners_px[i] = (*corners)[i] + rules.corner_noise_px * Eigen::Vector2d(du, dv);
    }
    out.push_back(sighting);
  }
  drop_doubled_ids(out);
}

bool Faults::drops_imu(std::uint64_t k) const {
  return config_.drop_imu > 0 && Random(seed_, Purpose::kImuFaults, k).chance(config_.drop_imu);
}

Duration Faults::imu_delay(std::uint64_t k) const {
  if (config_.jitter_s == 0) return Duration{0};
  return from_seconds(config_.jitter_s *
                      std::abs(Random(seed_, Purpose::kImuFaults, k, 1).normal()));
}

bool Faults::drops_image(int camera, std::uint64_t k, double t_s) const {
  if (config_.blackout_every_s > 0 && t_s >= config_.blackout_every_s &&
      std::fmod(t_s, config_.blackout_every_s) < config_.blackout_s) {
    return true;
  }
  return config_.drop_image > 0 &&
         for_image(seed_, Purpose::kImageFaults, camera, k).chance(config_.drop_image);
}

Duration Faults::image_delay(int camera, std::uint64_t k) const {
  Random random = for_image(seed_, Purpose::kImageFaults, camera, k);
  (void)random.uniform();  // the draw of drops_image
  return from_seconds(config_.delay_image_s + config_.jitter_s * std::abs(random.normal()));
}

void Faults::change_tags(int camera, std::uint64_t k, double t_s,
                         std::vector<RecordedTag>& tags) const {
  Random random = for_image(seed_, Purpose::kTagFaults, camera, k);
  std::size_t kept = 0;
  for (RecordedTag tag : tags) {
    const bool hidden = random.chance(config_.occlude);
    const bool wrong = random.chance(config_.wrong_id);
    const int shift = 1 + random.below(ids_ - 1);
    if (tag.tag_id == config_.moved_tag && t_s >= config_.moved_at_s)
      tag.X_WT.p += config_.moved_by_m;
    if (wrong) tag.tag_id = (tag.tag_id + shift) % ids_;
    if (!hidden) tags[kept++] = tag;
  }
  tags.resize(kept);
}

void Faults::cover_corners(int camera, std::uint64_t k, std::vector<TagSighting>& sightings) const {
  if (config_.occlude_corner == 0) return;
  // Covered further, the tag could not be decoded.
  constexpr double kBorder = 1.0 / 8;
  for (TagSighting& tag : sightings) {
    Random random(seed_, Purpose::kCornerFaults,
                  static_cast<std::uint64_t>(camera) << 32 | static_cast<std::uint32_t>(tag.tag_id),
                  k);
    const bool covered = random.chance(config_.occlude_corner);
    const auto corner = static_cast<std::size_t>(random.below(4));
    const double ahead = random.uniform(0, kBorder);
    const double back = random.uniform(0, kBorder);
    if (!covered) continue;
    auto& px = tag.corners_px;
    px[corner] +=
        ahead * (px[(corner + 1) % 4] - px[corner]) + back * (px[(corner + 3) % 4] - px[corner]);
  }
}

Duration Faults::image_stamp_error() const { return from_seconds(config_.image_stamp_error_s); }

Duration Faults::imu_stamp_error(std::uint64_t k, double rate_hz) const {
  if (config_.imu_stamp_jitter_s == 0) return Duration{0};
  constexpr double kMost = 0.45;  // of the period; less than half keeps the order
  const double drawn =
      config_.imu_stamp_jitter_s * Random(seed_, Purpose::kStampFaults, k).normal();
  return from_seconds(std::clamp(drawn, -kMost / rate_hz, kMost / rate_hz));
}

void Faults::saturate(double t_s, ImuSample& imu) const {
  if (t_s < config_.saturation_at_s || t_s >= config_.saturation_at_s + config_.saturation_s)
    return;
  imu.w_WB_B = clamped(imu.w_WB_B, config_.saturated_gyro_rad_s);
  imu.f_B = clamped(imu.f_B, config_.saturated_accel_m_s2);
}

}  // namespace fiducap::simulation
