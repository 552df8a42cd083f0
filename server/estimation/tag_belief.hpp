#pragma once

#include "base/time.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// What one body's filter thinks of one tag in its state, in the workspace axes. Input of mapping.
struct TagBelief {
  KnownTag tag;
  int sightings{};
  Instant first_seen{};
  Instant last_seen{};
};

}  // namespace fiducap
