#include "simulation/bound_run.hpp"

#include <algorithm>

#include "base/assert.hpp"

namespace fiducap {

std::vector<int> ids_in(const CornerFrame& image, const EstimationData& data) {
  std::vector<int> ids;
  for (const TagSighting& seen : image.tags) {
    if (data.tag(seen.tag_id) != nullptr) ids.push_back(seen.tag_id);
  }
  return ids;
}

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge) {
  const bound::Matrix8 alike = bound::Matrix8::Identity() / data.corner_noise_px;
  const auto noise = [&](const CornerFrame&, const TagSighting& tag) {
    return bound::TagSight{.tag_id = tag.tag_id, .whiten = alike};
  };
  return run_bound(data, knowledge, noise, std::nullopt);
}

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge, const SightNoise& noise,
                   const std::optional<bound::LastingErrors>& lasting) {
  FIDUCAP_ASSERT(data.imu.has_value());
  bound::BoundProblem problem;
  problem.camera = data.camera;
  problem.imu = *data.imu;
  problem.gravity_m_s2 = data.gravity_m_s2;
  problem.corner_noise_px = data.corner_noise_px;
  problem.tags = data.tags;
  problem.reference_tag = data.reference_tag;
  problem.map_known = knowledge.map_known();
  problem.extrinsics_known = knowledge.extrinsics_known();
  problem.lasting = lasting;
  bound::CausalBound bound(problem);

  BoundRun run;
  std::optional<Instant> reference_seen;
  auto next = data.truth.begin();
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image == nullptr) continue;
    for (; next != data.truth.end() && next->at <= image->exposed_at; ++next) bound.move_to(*next);
    const std::vector<int> ids = ids_in(*image, data);
    if (std::find(ids.begin(), ids.end(), data.reference_tag) != ids.end()) {
      const bool returns =
          reference_seen && to_seconds(image->exposed_at - *reference_seen) > kAway_s;
      if (returns && !run.gap && !run.at.empty()) run.gap = run.at.back();
      reference_seen = image->exposed_at;
    }
    std::vector<bound::TagSight> sights;
    for (const TagSighting& seen : image->tags) {
      if (data.tag(seen.tag_id) != nullptr) sights.push_back(noise(*image, seen));
    }
    bound.see(sights);
    if (const auto now = bound.now()) run.at.push_back(*now);
  }
  run.map = bound.map();
  return run;
}

}  // namespace fiducap
