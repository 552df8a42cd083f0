#include "scene/tag_fits.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

constexpr std::uint64_t kRecent = 50;  // sightings: two seconds of one camera

}  // namespace

void TagFits::note(const UpdateReport& report) {
  if (report.tags_measured == 0 || report.start_is_open) return;
  const std::lock_guard lock(mutex_);
  for (const auto& fit : report.named_fits()) note(fit, report.exposed_at);
}

void TagFits::note(const UpdateReport::CornerFit& fit, Instant seen_at) {
  if (!std::isfinite(fit.rms_px)) return;
  auto at = std::lower_bound(fits_.begin(), fits_.end(), fit.tag_id,
                             [](const TagFit& one, int id) { return one.tag_id < id; });
  if (at == fits_.end() || at->tag_id != fit.tag_id) {
    if (fits_.size() == kMostTags) return;
    at = fits_.insert(at, TagFit{.tag_id = fit.tag_id});
  }
  const auto weight = static_cast<double>(std::min(++at->sightings, kRecent));
  const double square = at->rms_px * at->rms_px;
  at->rms_px = std::sqrt(square + (fit.rms_px * fit.rms_px - square) / weight);
  at->seen_at = std::max(at->seen_at, seen_at);
}

std::vector<TagFit> TagFits::list() const {
  const std::lock_guard lock(mutex_);
  return fits_;
}

}  // namespace fiducap
