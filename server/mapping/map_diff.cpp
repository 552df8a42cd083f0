#include "mapping/map_diff.hpp"

#include <cmath>

#include "base/so3.hpp"

namespace fiducap {

namespace {

constexpr double kMoved_m = 1e-6;
constexpr double kTurned_rad = 1e-6;

}  // namespace

std::string_view name_of(TagChange::Kind kind) {
  switch (kind) {
    case TagChange::Kind::kAdded:
      return "added";
    case TagChange::Kind::kRemoved:
      return "removed";
    case TagChange::Kind::kMoved:
      return "moved";
  }
  return "moved";
}

std::vector<TagChange> diff(const TagMap& before, const TagMap& after) {
  std::vector<TagChange> changes;
  auto b = before.tags.begin();
  auto a = after.tags.begin();
  while (b != before.tags.end() || a != after.tags.end()) {
    if (a == after.tags.end() || (b != before.tags.end() && b->tag.tag_id < a->tag.tag_id)) {
      changes.push_back({b++->tag.tag_id, TagChange::Kind::kRemoved});
      continue;
    }
    if (b == before.tags.end() || a->tag.tag_id < b->tag.tag_id) {
      changes.push_back({a++->tag.tag_id, TagChange::Kind::kAdded});
      continue;
    }
    const double distance = (a->tag.X_WT.p - b->tag.X_WT.p).norm();
    const double angle = angle_between(b->tag.X_WT.q, a->tag.X_WT.q);
    if (distance > kMoved_m || angle > kTurned_rad) {
      changes.push_back(
          {a->tag.tag_id, TagChange::Kind::kMoved, distance * 1e3, angle * 180.0 / M_PI});
    }
    ++a;
    ++b;
  }
  return changes;
}

}  // namespace fiducap
