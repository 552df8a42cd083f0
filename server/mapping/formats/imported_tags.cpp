#include "mapping/formats/imported_tags.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
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

Expected<void> ImportedTags::add(MapTag entry, const std::string& context) {
  if (const auto fault = fault_in(entry)) return fail(ErrorCode::kInvalid, *fault, context);
  restore_unit(entry.tag.X_WT);
  const int id = entry.tag.tag_id;
  if (const auto [first, is_new] = places_.try_emplace(id, context); !is_new) {
    return fail(ErrorCode::kInvalid,
                "tag id " + std::to_string(id) + " is there twice" +
                    (first->second.empty() ? "" : ", first at " + first->second),
                context);
  }
  tags_.push_back(std::move(entry));
  return {};
}

std::vector<MapTag> ImportedTags::take() {
  // Only indices are sorted: a tag with its covariance is large.
  std::vector<std::size_t> order(tags_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
    return tags_[a].tag.tag_id < tags_[b].tag.tag_id;
  });
  std::vector<MapTag> sorted;
  sorted.reserve(tags_.size());
  for (const std::size_t i : order) sorted.push_back(std::move(tags_[i]));
  tags_.clear();
  places_.clear();
  return sorted;
}

}  // namespace fiducap
