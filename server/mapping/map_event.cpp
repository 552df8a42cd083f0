#include "mapping/map_event.hpp"

namespace fiducap {

std::string_view name_of(MapEvent::Kind kind) {
  switch (kind) {
    case MapEvent::Kind::kTagAdded:
      return "tag_added";
    case MapEvent::Kind::kTagRefined:
      return "tag_refined";
    case MapEvent::Kind::kTagQuarantined:
      return "tag_quarantined";
    case MapEvent::Kind::kTagMoved:
      return "tag_moved";
    case MapEvent::Kind::kTagDisputed:
      return "tag_disputed";
    case MapEvent::Kind::kTagCalibrated:
      return "tag_settled";
    case MapEvent::Kind::kWorkspace:
      return "workspace_defined";
    case MapEvent::Kind::kPublished:
      return "map_stored";
  }
  return "map_stored";
}

}  // namespace fiducap
