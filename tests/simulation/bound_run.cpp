#include "simulation/bound_run.hpp"

#include <algorithm>

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

}  // namespace

std::optional<Closure> closure_of(const EstimationData& data) {
  std::optional<Instant> seen;
  std::optional<Instant> before;
  std::optional<Closure> closure;
  for_each_image(data, [&](const CornerFrame& image) {
    if (shows(image, data.reference_tag)) {
      if (!closure && seen && to_seconds(image.exposed_at - *seen) > kAway_s)
        closure = {*before, image.exposed_at};
      seen = image.exposed_at;
    }
    before = image.exposed_at;
  });
  return closure;
}

std::vector<Instant> images_spread(const EstimationData& data, int count, double from_s) {
  std::vector<Instant> all;
  const Instant from = time_of(data.samples.front()) + from_seconds(from_s);
  for_each_image(data, [&](const CornerFrame& image) {
    if (image.exposed_at >= from) all.push_back(image.exposed_at);
  });
  const auto wanted = std::min(all.size(), static_cast<std::size_t>(count));
  std::vector<Instant> out;
  // Each in the middle of its share of the time.
  for (std::size_t i = 0; i < wanted; ++i)
    out.push_back(all[(2 * i + 1) * all.size() / (2 * wanted)]);
  return out;
}

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge,
                   const std::vector<Instant>& kept) {
  const bound::Matrix8 equal = bound::Matrix8::Identity() / data.corner_noise_px;
  const auto noise = [&](const CornerFrame&, const TagSighting& tag) {
    return bound::TagSight{.tag_id = tag.tag_id, .whiten = equal};
  };
  return run_bound(data, knowledge, noise, std::nullopt, kept);
}

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge, const SightNoise& noise,
                   const std::optional<bound::LastingErrors>& lasting,
                   const std::vector<Instant>& kept) {
  bound::BoundProblem problem = problem_of(data, knowledge);
  problem.lasting = lasting;
  bound::CausalBound bound(problem);

  BoundRun run;
  const std::optional<Closure> closure = closure_of(data);
  auto next = data.truth.begin();
  for_each_image(data, [&](const CornerFrame& image) {
    const Instant at = image.exposed_at;
    for (; next != data.truth.end() && next->at <= at; ++next) bound.move_to(*next);
    std::vector<bound::TagSight> sights;
    for (const TagSighting& seen : image.tags)
      if (data.tag(seen.tag_id) != nullptr) sights.push_back(noise(image, seen));
    const bool closes = closure && at == closure->closes;
    if (closes && !run.at.empty()) run.gap = run.at.back();
    bound.see(sights);
    if (std::find(kept.begin(), kept.end(), at) != kept.end()) bound.keep_pose();
    const auto now = bound.now();
    if (!now) return;
    run.at.push_back(*now);
    if (closes) run.gap_after = *now;
  });
  run.map = bound.map();
  run.smoothed = bound.kept();
  if (!knowledge.map_known()) run.tags = bound.tags();
  return run;
}

}  // namespace fiducap
