#pragma once

#include <string>
#include <string_view>

namespace fiducap {

/// Something about the map that people and protocols should hear of.
struct MapEvent {
  enum class Kind {
    kTagAdded,        ///< A tag joined the map.
    kTagRefined,      ///< Another body knows the tag better and owns it now.
    kTagQuarantined,  ///< A tag contradicts the others: it moved, or another one has its id.
    kTagMoved,        ///< A quarantined tag was learned anew.
    kTagDisputed,     ///< A body sees a tag a little off its place; the place stays.
    kTagCalibrated,   ///< A tag has settled.
    kWorkspace,       ///< A body has defined the workspace.
    kPublished,       ///< The map was stored as a version.
  } kind{Kind::kPublished};
  int tag_id{};  ///< 0 when it is not about a tag.
  std::string text;
};

/// `tag_added`, `tag_refined`, …
[[nodiscard]] std::string_view name_of(MapEvent::Kind kind);

}  // namespace fiducap
