#pragma once

#include <string>
#include <vector>

#include "pipeline/replay/map_build.hpp"

namespace fiducap {

/// What a person is told about a map that was made of recordings.
struct MapBuildText {
  const MapBuild& build;
  const std::vector<std::string>& recordings;  ///< As they were given.
  int publish_sightings{};

  /// Tags, recordings, sigmas, fit.
  [[nodiscard]] std::string summary() const;
  /// What did not become part of the map, why, and what to do: a sentence each.
  [[nodiscard]] std::vector<std::string> left_out() const;
  [[nodiscard]] std::string json() const;
};

/// Tags of the map that recordings have placed, not a survey.
[[nodiscard]] int tags_placed(const TagMap& map);

}  // namespace fiducap
