#include "mapping/map_news.hpp"

#include <utility>

namespace fiducap {

namespace {

constexpr int kViewsToTell = 10;

bool lacks(const std::map<int, int>& told, int body_id) {
  const auto found = told.find(body_id);
  return found == told.end() || found->second < kViewsToTell;
}

}  // namespace

void MapNews::replace(std::shared_ptr<const TagMap> with_ties) {
  is_replaced_ = true;
  with_ties_ = std::move(with_ties);
  told_.clear();
  forgotten_.clear();
}

void MapNews::forget(int tag_id) { forgotten_[tag_id].clear(); }

void MapNews::tell(int body_id, MapView& view) {
  if (is_behind(body_id)) {
    ++told_[body_id];
    if (with_ties_ != nullptr) view.map = with_ties_;
  }
  for (auto& [tag_id, told] : forgotten_) {
    if (!lacks(told, body_id)) continue;
    ++told[body_id];
    view.forget.push_back(tag_id);
  }
}

bool MapNews::is_behind(int body_id) const { return is_replaced_ && lacks(told_, body_id); }

bool MapNews::is_behind(int body_id, int tag_id) const {
  const auto found = forgotten_.find(tag_id);
  return found != forgotten_.end() && lacks(found->second, body_id);
}

}  // namespace fiducap
