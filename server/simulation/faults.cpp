#include "simulation/faults.hpp"

#include <algorithm>
#include <cmath>

#include "simulation/random.hpp"

namespace fiducap::simulation {

namespace {

Random for_image(std::uint64_t seed, Purpose purpose, int camera, std::uint64_t k) {
  return {seed, purpose, static_cast<std::uint64_t>(camera), k};
}

}  // namespace

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
  (void)random.uniform();  // the draw that decides about dropping
  return from_seconds(config_.delay_image_s + config_.jitter_s * std::abs(random.normal()));
}

void Faults::touch(int camera, std::uint64_t k, double t_s, std::vector<RecordedTag>& tags) const {
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

void Faults::cover(int camera, std::uint64_t k, std::vector<TagSighting>& sightings) const {
  if (config_.occlude_corner == 0) return;
  // Covered further, the tag could not be decoded any more.
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
  constexpr double kMost = 0.45;  // of the period: less than half, so that order stays
  const double drawn =
      config_.imu_stamp_jitter_s * Random(seed_, Purpose::kStampFaults, k).normal();
  return from_seconds(std::clamp(drawn, -kMost / rate_hz, kMost / rate_hz));
}

void Faults::saturate(double t_s, ImuSample& imu) const {
  if (t_s < config_.saturation_at_s || t_s >= config_.saturation_at_s + config_.saturation_s)
    return;
  const auto cut = [](Eigen::Vector3d& x, double range) {
    x = x.cwiseMax(-range).cwiseMin(range).eval();
  };
  cut(imu.w_WB_B, config_.saturated_gyro_rad_s);
  cut(imu.f_B, config_.saturated_accel_m_s2);
}

}  // namespace fiducap::simulation
