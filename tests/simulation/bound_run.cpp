#include "simulation/bound_run.hpp"

#include "base/expected.hpp"

namespace fiducap {

namespace {

bound::BoundProblem problem_of(const EstimationData& data, KnowledgeCase knowledge) {
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
  return problem;
}

/// The image that closes a loop for the first time.
std::optional<Instant> closure_of(const EstimationData& data) {
  std::optional<Instant> seen;
  std::optional<Instant> closure;
  for_each_image(data, [&](const CornerFrame& image) {
    if (!shows(image, data.reference_tag)) return;
    if (!closure && seen && to_seconds(image.exposed_at - *seen) > kAway_s)
      closure = image.exposed_at;
    seen = image.exposed_at;
  });
  return closure;
}

}  // namespace

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge) {
  const bound::Matrix8 equal = bound::Matrix8::Identity() / data.corner_noise_px;
  const auto noise = [&](const CornerFrame&, const TagSighting& tag) {
    return bound::TagSight{.tag_id = tag.tag_id, .whiten = equal};
  };
  return run_bound(data, knowledge, noise, std::nullopt);
}

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge, const SightNoise& noise,
                   const std::optional<bound::LastingErrors>& lasting) {
  bound::BoundProblem problem = problem_of(data, knowledge);
  problem.lasting = lasting;
  bound::CausalBound bound(problem);

  BoundRun run;
  const std::optional<Instant> closure = closure_of(data);
  auto next = data.truth.begin();
  for_each_image(data, [&](const CornerFrame& image) {
    const Instant at = image.exposed_at;
    for (; next != data.truth.end() && next->at <= at; ++next) bound.move_to(*next);
    std::vector<bound::TagSight> sights;
    for (const TagSighting& seen : image.tags)
      if (data.tag(seen.tag_id) != nullptr) sights.push_back(noise(image, seen));
    if (closure == at && !run.at.empty()) run.gap = run.at.back();
    bound.see(sights);
    if (const auto now = bound.now()) run.at.push_back(*now);
  });
  run.map = bound.map();
  if (!knowledge.map_known()) run.tags = bound.tags();
  return run;
}

}  // namespace fiducap
