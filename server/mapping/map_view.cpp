#include "mapping/map_view.hpp"

#include <array>
#include <utility>

namespace fiducap {

namespace {

constexpr std::array<std::string_view, 8> kEventNames{
    "tag_added",    "tag_refined", "tag_quarantined",   "tag_moved",
    "tag_disputed", "tag_settled", "workspace_defined", "map_stored"};  // in the order of the enum
constexpr int kViewsPerChange = 10;

bool lacks(const std::map<int, int>& sent, int body_id) {
  const auto found = sent.find(body_id);
  return found == sent.end() || found->second < kViewsPerChange;
}

}  // namespace

std::string_view name_of(MapEvent::Kind kind) {
  return kEventNames[static_cast<std::size_t>(kind)];
}

void PendingChanges::replace(std::shared_ptr<const TagMap> correlated) {
  is_replaced_ = true;
  correlated_ = std::move(correlated);
  replacement_.clear();
  forgotten_.clear();
}

void PendingChanges::forget(int tag_id) { forgotten_[tag_id].clear(); }

void PendingChanges::add_to(MapView& view) {
  if (is_outdated(view.body_id)) {
    ++replacement_[view.body_id];
    if (correlated_ != nullptr) view.map = correlated_;
  }
  for (auto& [tag_id, sent] : forgotten_) {
    if (!lacks(sent, view.body_id)) continue;
    ++sent[view.body_id];
    view.forget.push_back(tag_id);
  }
}

bool PendingChanges::is_outdated(int body_id) const {
  return is_replaced_ && lacks(replacement_, body_id);
}

bool PendingChanges::is_outdated(int body_id, int tag_id) const {
  const auto found = forgotten_.find(tag_id);
  return found != forgotten_.end() && lacks(found->second, body_id);
}

}  // namespace fiducap
