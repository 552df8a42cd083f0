#pragma once

#include <optional>
#include <vector>

#include "base/time.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/known_map.hpp"

namespace fiducap {

/// A tag as the graph has it, in the axes of the map.
struct GraphTagEstimate {
  int tag_id{};
  double edge_m{};
  int component{};
  int sightings{};
  Instant first_seen{};
  Instant last_seen{};
  Pose X_WT;
  /// As KnownTag::covariance, against the mean place and heading of the tags that define W.
  Matrix6d covariance{Matrix6d::Zero()};
  int epoch{};            ///< How often it had been moved …
  bool is_current{true};  ///< … and has not been since: this is where it is now.
};

/// What is not as the configuration says.
struct GraphFinding {
  int body_id{-1};  ///< Whose camera; -1: of prints.
  FoundMismatch what;
};

struct GraphSolution {
  std::vector<GraphTagEstimate> tags;  ///< By id; an id may be there once per component and epoch.
  std::vector<KnownPair> pairs;        ///< Tags seen together, where they are now; sorted.
  std::vector<GraphFinding> findings;
  double cost{};     ///< Twice: chi-square …
  double numbers{};  ///< … of so many.
  int iterations{};
  int condensed{};  ///< Segments linearised anew.
  /// Of a tag, for the map to have it; nullopt: as the map is configured.
  std::optional<int> least_sightings{};
};

}  // namespace fiducap
