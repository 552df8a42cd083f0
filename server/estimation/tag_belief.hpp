#pragma once

#include "base/time.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// What one body's filter thinks of one tag in its state. Input of mapping.
struct TagBelief {
  static constexpr int kWorkspace = 0;
  static constexpr int kOwnAxes = -1;

  KnownTag tag;
  int sightings{};
  Instant first_seen{};
  Instant last_seen{};
  /// Whose axes `tag.X_WT` is in: the workspace, or the body's own, not anchored yet.
  int component{kWorkspace};
};

}  // namespace fiducap
