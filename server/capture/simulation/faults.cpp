#include "capture/simulation/faults.hpp"

#include <cmath>

#include "capture/simulation/random.hpp"

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

}  // namespace fiducap::simulation
