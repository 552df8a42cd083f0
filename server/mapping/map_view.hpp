#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The map as one body gets it for one image.
struct MapView {
  std::shared_ptr<const TagMap> map;
  bool may_define_workspace{true};  ///< See MapKnowledge.
  std::uint64_t revision{};         ///< Number of publications before; counts from 0.
  int body_id{-1};
};

/// What one body contributes to the map after an image.
struct MapContribution {
  int body_id{};
  std::uint64_t revision{};  ///< Of the map that the body had (MapView).
  Instant at{};
  bool anchored{};                       ///< The axes of the body's filter are the workspace's.
  std::span<const TagBelief> beliefs{};  ///< Tags in the state of the body's filter.
  std::span<const int> contradicted{};   ///< Tags whose place the body's filter has rejected.
  std::span<const int> fitting{};        ///< Tags found where the map has them.
  std::shared_ptr<const MotionSegment> segment{};  ///< That has ended, or nullptr.
};

/// A change of the map, for users and protocols.
struct MapEvent {
  enum class Kind {
    kTagAdded,        ///< A tag joined the map.
    kTagQuarantined,  ///< A tag contradicts the others: it moved, or another one has its id.
    kTagMoved,        ///< A quarantined tag has a new place.
    kTagDisputed,     ///< A body sees a tag slightly off its place; the place is kept.
    kWorkspace,       ///< A body has defined the workspace.
    kPublished,       ///< The map was stored as a version.
  } kind{Kind::kPublished};
  int tag_id{};  ///< 0: not about a tag.
  std::string text;
};

/// `tag_added`, `tag_quarantined`, …
[[nodiscard]] std::string_view name_of(MapEvent::Kind kind);

}  // namespace fiducap
