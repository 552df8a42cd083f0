#include "simulation/bound_run.hpp"

#include <algorithm>

#include "base/expected.hpp"

namespace fiducap {

std::optional<Closure> closure_of(const EstimationData& data) {
  std::optional<Instant> seen;
  std::optional<Instant> before;
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image == nullptr) continue;
    const bool sees =
        std::any_of(image->tags.begin(), image->tags.end(),
                    [&](const TagSighting& t) { return t.tag_id == data.reference_tag; });
    if (sees) {
      if (seen && to_seconds(image->exposed_at - *seen) > kAway_s)
        return Closure{*before, image->exposed_at};
      seen = image->exposed_at;
    }
    before = image->exposed_at;
  }
  return std::nullopt;
}

std::vector<Instant> images_spread(const EstimationData& data, int count, double from_s) {
  std::vector<Instant> all;
  const Instant from = time_of(data.samples.front()) + from_seconds(from_s);
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image != nullptr && image->exposed_at >= from) all.push_back(image->exposed_at);
  }
  const auto wanted = std::min(all.size(), static_cast<std::size_t>(count));
  std::vector<Instant> out;
  // Each in the middle of its share of the time.
  for (std::size_t i = 0; i < wanted; ++i)
    out.push_back(all[(2 * i + 1) * all.size() / (2 * wanted)]);
  return out;
}

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge,
                   const std::vector<Instant>& kept) {
  const bound::Matrix8 alike = bound::Matrix8::Identity() / data.corner_noise_px;
  const auto noise = [&](const CornerFrame&, const TagSighting& tag) {
    return bound::TagSight{.tag_id = tag.tag_id, .whiten = alike};
  };
  return run_bound(data, knowledge, noise, std::nullopt, kept);
}

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

BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge, const SightNoise& noise,
                   const std::optional<bound::LastingErrors>& lasting,
                   const std::vector<Instant>& kept) {
  bound::BoundProblem problem = problem_of(data, knowledge);
  problem.lasting = lasting;
  bound::CausalBound bound(problem);

  BoundRun run;
  const std::optional<Closure> closure = closure_of(data);
  auto next = data.truth.begin();
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image == nullptr) continue;
    for (; next != data.truth.end() && next->at <= image->exposed_at; ++next) bound.move_to(*next);
    std::vector<bound::TagSight> sights;
    for (const TagSighting& seen : image->tags) {
      if (data.tag(seen.tag_id) != nullptr) sights.push_back(noise(*image, seen));
    }
    if (closure && image->exposed_at == closure->closes && !run.at.empty()) run.gap = run.at.back();
    bound.see(sights);
    if (std::find(kept.begin(), kept.end(), image->exposed_at) != kept.end()) bound.keep_pose();
    const auto now = bound.now();
    if (!now) continue;
    run.at.push_back(*now);
    if (closure && image->exposed_at == closure->closes) run.gap_after = *now;
  }
  run.map = bound.map();
  run.smoothed = bound.kept();
  if (!knowledge.map_known()) run.tags = bound.tags();
  return run;
}

}  // namespace fiducap
