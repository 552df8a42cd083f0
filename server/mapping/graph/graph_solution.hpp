#pragma once

#include <optional>
#include <vector>

#include "base/time.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// A tag has left its place: sightings after `gone` are not of that place any more, those after
/// `back` are of the next one; those between are of neither.
struct TagEpoch {
  Instant gone{};
  Instant back{};  ///< Instant::max(): the tag is not used any more.
};

/// From the map to the graph, in order.
struct EpochOrder {
  int tag_id{};
  std::optional<TagEpoch> opens{};  ///< nullopt: the newest place is the one before, after all.
};

/// The graph's estimate of a tag, in the axes of the map.
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
  bool is_current{true};  ///< … and has not been since.
};

/// A deviation from the configuration.
struct GraphFinding {
  int body_id{-1};  ///< Whose camera; -1: of tag sizes.
  FoundMismatch what;
};

struct GraphSolution {
  std::vector<GraphTagEstimate> tags;  ///< By id; an id may occur once per component and epoch.
  std::vector<KnownPair> pairs;        ///< Tags seen together, at their present places; sorted.
  std::vector<GraphFinding> findings;
  double cost{};     ///< Twice: chi-square …
  double numbers{};  ///< … and the number of its terms.
  int iterations{};
  int condensed{};  ///< Segments linearised again.
  /// Of a tag that joins the map; nullopt: as the map is configured.
  std::optional<int> least_sightings{};
};

}  // namespace fiducap
