#include "mapping/map_view.hpp"

#include <array>

namespace fiducap {

namespace {

constexpr std::array<std::string_view, 6> kEventNames{
    // in the order of the enum
    "tag_added", "tag_quarantined", "tag_moved", "tag_disputed", "workspace_defined", "map_stored"};

}  // namespace

std::string_view name_of(MapEvent::Kind kind) {
  return kEventNames[static_cast<std::size_t>(kind)];
}

}  // namespace fiducap
