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
  return run_bound(data, knowledge,
                   [&](const CornerFrame&, const TagSighting&) { return data.corner_noise_px; });
}

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge,
                   const CornerSigma& sigma_px) {
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
    std::vector<double> noise_px;
    for (const TagSighting& seen : image->tags) {
      if (data.tag(seen.tag_id) != nullptr) noise_px.push_back(sigma_px(*image, seen));
    }
    bound.see(ids, noise_px);
    if (const auto now = bound.now()) run.at.push_back(*now);
  }
  run.map = bound.map();
  return run;
}

}  // namespace fiducap
