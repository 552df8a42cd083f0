#include "mapping/formats/imported_tags.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fiducap {

namespace {

// What our own writer gives stays bit for bit as it is.
constexpr double kUnitToRounding = 1e-14;

}  // namespace

Expected<void> check_length(const std::string& text, const std::string& context) {
  if (text.size() <= kLongestMapText) return {};
  return fail(ErrorCode::kInvalid,
              "has " + std::to_string(text.size()) + " bytes, a map has at most 64 MiB", context);
}

void restore_unit(Pose& pose) {
  if (std::abs(pose.q.norm() - 1.0) > kUnitToRounding) pose.q.normalize();
}

Expected<void> add_imported(TagMap& map, MapTag entry, const std::string& context) {
  if (const auto fault = fault_in(entry)) return fail(ErrorCode::kInvalid, *fault, context);
  restore_unit(entry.tag.X_WT);
  const int id = entry.tag.tag_id;
  // Maps are usually written in order; then this is the end.
  const auto place =
      std::lower_bound(map.tags.begin(), map.tags.end(), id,
                       [](const MapTag& other, int tag_id) { return other.tag.tag_id < tag_id; });
  if (place != map.tags.end() && place->tag.tag_id == id) {
    return fail(ErrorCode::kInvalid, "tag id " + std::to_string(id) + " is there twice", context);
  }
  map.tags.insert(place, std::move(entry));
  return {};
}

}  // namespace fiducap
