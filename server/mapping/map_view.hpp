#pragma once

#include <cstdint>
#include <map>
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
  std::vector<int> forget{};        ///< Tags that the body has to discard; mostly none.
  int body_id{-1};
};

/// What one body contributes to the map after an image.
struct MapContribution {
  int body_id{};
  Instant at{};
  bool anchored{};  ///< The axes of the body's filter are the workspace's.
  std::span<const TagBelief> beliefs{};
  std::span<const int> contradicted{};  ///< Tags whose place the body's filter has rejected.
  std::span<const int> fitting{};       ///< Tags found where the map has them.
  std::shared_ptr<const MotionSegment> segment{};  ///< That has ended, or nullptr.
};

/// A change of the map, for users and protocols.
struct MapEvent {
  enum class Kind {
    kTagAdded,        ///< A tag joined the map.
    kTagRefined,      ///< Another body has the better estimate of the tag and owns it now.
    kTagQuarantined,  ///< A tag contradicts the others: it moved, or another one has its id.
    kTagMoved,        ///< A quarantined tag has a new place.
    kTagDisputed,     ///< A body sees a tag slightly off its place; the place is kept.
    kTagCalibrated,   ///< A tag has settled.
    kWorkspace,       ///< A body has defined the workspace.
    kPublished,       ///< The map was stored as a version.
  } kind{Kind::kPublished};
  int tag_id{};  ///< 0: not about a tag.
  std::string text;
};

/// `tag_added`, `tag_refined`, …
[[nodiscard]] std::string_view name_of(MapEvent::Kind kind);

/// Changes by an operator that a body may not have received yet: each goes out with the views for
/// the body's next ten images, since not every image reaches the filter (a late camera's, for
/// example). Until then the body's contributions refer to the map before the change.
class PendingChanges final {
 public:
  /// The map was replaced.
  /// @param correlated  the new map with `known`: a filter that adopts it moves its whole state.
  /// Only for a map that keeps no correlations (no graph); else nullptr
  void replace(std::shared_ptr<const TagMap> correlated);
  /// A tag was forgotten.
  void forget(int tag_id);
  /// Adds to a view what its body has not received yet.
  void add_to(MapView& view);
  /// The body has not received the replacement yet …
  [[nodiscard]] bool is_outdated(int body_id) const;
  /// … or that the tag was forgotten.
  [[nodiscard]] bool is_outdated(int body_id, int tag_id) const;

 private:
  using Sent = std::map<int, int>;  ///< Number of views with the change, by body.

  bool is_replaced_{false};
  std::shared_ptr<const TagMap> correlated_;
  Sent replacement_;
  std::map<int, Sent> forgotten_;  ///< By tag.
};

}  // namespace fiducap
