#include "estimation/conversation/restless_tags.hpp"

#include <algorithm>

namespace fiducap {

namespace {
// The first time it may just have been moved. From the second on it stays away for so long, twice
// as long each time, but no longer than that.
constexpr Duration kFirstPause = std::chrono::seconds(20);
constexpr int kMostDoublings = 6;
// What happened longer ago does not count.
constexpr Duration kForgiven = std::chrono::minutes(30);
}  // namespace

void RestlessTags::note_given_up(int tag_id, Instant at) {
  auto known = std::find_if(tags_.begin(), tags_.end(),
                            [&](const Restless& r) { return r.tag_id == tag_id; });
  if (known == tags_.end()) {
    known = tags_.begin() + static_cast<std::ptrdiff_t>(next_);
    next_ = (next_ + 1) % tags_.size();
    *known = {tag_id, 0, at};
  }
  if (at - known->last > kForgiven) known->times = 0;
  ++known->times;
  known->last = at;
}

bool RestlessTags::is_barred(int tag_id, Instant now) const {
  const auto known = std::find_if(tags_.begin(), tags_.end(),
                                  [&](const Restless& r) { return r.tag_id == tag_id; });
  if (known == tags_.end() || known->times < 2) return false;
  const int doublings = std::min(known->times - 2, kMostDoublings);
  return now - known->last < kFirstPause * (1 << doublings);
}

}  // namespace fiducap
