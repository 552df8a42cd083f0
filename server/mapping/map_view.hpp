#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "estimation/tag_belief.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The map as one body gets it for one image.
struct MapView {
  std::shared_ptr<const TagMap> map;
  bool may_define_workspace{true};  ///< See MapKnowledge.
  std::uint64_t revision{};         ///< How often the map was published before; counts from 0.
  std::vector<int> forget{};        ///< Tags that the body is to learn anew; mostly none.
  int body_id{-1};                  ///< Whose.
};

/// What one body tells the map after an image.
struct MapContribution {
  int body_id{};
  Instant at{};
  bool anchored{};  ///< The body's filter stands in the workspace.
  std::span<const TagBelief> beliefs{};
  std::span<const int> contradicted{};  ///< Tags that the body's filter gave up for their place.
  std::span<const int> fitting{};       ///< Tags that it found where the map has them.
  std::shared_ptr<const MotionSegment> segment{};  ///< That has ended, or nullptr.
};

}  // namespace fiducap
