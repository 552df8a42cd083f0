#include "pipeline/replay/image_log.hpp"

#include <algorithm>

namespace fiducap {

double size_px(const TagObservation& tag) { return (tag.corners_px[0] - tag.corners_px[2]).norm(); }

void ImageLog::add(const BodyUpdate& update) {
  std::vector<KnownTag> tags = update.known;
  for (const TagBelief& belief : update.beliefs) tags.push_back(belief.tag);
  add(update.seen, update.is_placed() ? std::optional(update.estimate->X_WB) : std::nullopt, tags);
}

void ImageLog::add(const TagObservations& seen, const std::optional<Pose>& X_WB,
                   std::span<const KnownTag> tags) {
  if (seen.tags.empty()) return;
  if (instants_.empty() || instants_.back().at != seen.exposed_at)
    instants_.push_back({seen.exposed_at, {}, {}});
  LoggedInstant& instant = instants_.back();
  instant.images.push_back(seen);
  if (!X_WB) return;
  const TagObservation* nearest = nullptr;
  const KnownTag* then = nullptr;
  for (const TagObservation& tag : seen.tags) {
    const auto found = std::find_if(tags.begin(), tags.end(),
                                    [&](const auto& t) { return t.tag_id == tag.tag_id; });
    if (found == tags.end() || (nearest != nullptr && size_px(tag) <= size_px(*nearest))) continue;
    nearest = &tag;
    then = &*found;
  }
  if (then != nullptr) instant.proposals.push_back({then->tag_id, then->X_WT.inverse() * *X_WB});
}

}  // namespace fiducap
