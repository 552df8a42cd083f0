#include "streaming/natnet/selection.hpp"

#include <algorithm>

namespace fiducap::natnet {

namespace {

bool before(const std::pair<int, bool>& one, int id) { return one.first < id; }

}  // namespace

void Selection::body(int id, bool wanted) {
  const auto at = std::lower_bound(bodies_.begin(), bodies_.end(), id, before);
  if (at != bodies_.end() && at->first == id) {
    at->second = wanted;
  } else {
    bodies_.insert(at, {id, wanted});
  }
}

bool Selection::has(int id) const {
  const auto at = std::lower_bound(bodies_.begin(), bodies_.end(), id, before);
  return at != bodies_.end() && at->first == id ? at->second : by_default();
}

bool Selection::is_everything() const {
  return by_default() && std::all_of(bodies_.begin(), bodies_.end(), [](const auto& one) { return one.second; });
}

bool Selection::by_default() const {
  return rigid_bodies_.value_or(all_types_.value_or(!subscribed_only_));
}

}  // namespace fiducap::natnet
