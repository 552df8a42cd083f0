#pragma once

#include <map>
#include <memory>

#include "mapping/map_view.hpp"

namespace fiducap {

/// What an operator did to the map, until each body has been told: with the views for its next ten
/// images, since not every image reaches its filter (of a camera that is late, for example). What a
/// body says before that is about the map of before.
class MapNews final {
 public:
  /// @param with_ties  the new map with `known`: a filter that takes it over moves all that it
  /// knows along, its own tags too. Only for a map that keeps no ties (no graph); else nullptr
  void replace(std::shared_ptr<const TagMap> with_ties);
  void forget(int tag_id);
  /// Puts in what the body has not been told yet.
  void tell(int body_id, MapView& view);
  /// It has not been told yet that the map was replaced …
  [[nodiscard]] bool is_behind(int body_id) const;
  /// … or that the tag was forgotten.
  [[nodiscard]] bool is_behind(int body_id, int tag_id) const;

 private:
  using Told = std::map<int, int>;  ///< How many views of each body have said so.

  bool is_replaced_{false};
  std::shared_ptr<const TagMap> with_ties_;
  Told told_;                      ///< Of the replacement …
  std::map<int, Told> forgotten_;  ///< … and of each forgotten tag.
};

}  // namespace fiducap
