#pragma once

#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// One of the recordings of a map.
struct MapBuildBody {
  OfflineBody body;  ///< Its `later` is set by build_map().
  Instant first{};   ///< Stamp of its first sample …
  Instant last{};    ///< … and of its last.
};

/// Result of one recording.
struct BuiltRecording {
  int images{};
  int images_with_tags{};
  std::string why_no_tag;  ///< Empty with tags, or without images.
  std::set<int> seen;      ///< Ids of tags.
  int segments{};          ///< Of about a second, usable for the graph …
  int segments_in_map{};   ///< … and those connected with the map.
};

/// A component of the graph that is not connected with the map.
struct MapPart {
  std::vector<std::size_t> recordings;
  std::vector<int> tag_ids;
  std::vector<int> also_in_map;  ///< Of these; their sightings disagree or are too few.
  int segments{};
};

struct MapFit {
  double chi_square_per_number{};  ///< 1: as the noises say.
  int sightings{};
  int outliers{};  ///< With less than half their weight.
};

struct MapBuild {
  TagMap map;
  std::vector<BuiltRecording> recordings;
  std::vector<MapPart> apart;
  std::map<int, int> seen_too_seldom;  ///< Sightings of connected tags that are not in the map.
  std::vector<std::string> moved;      ///< Messages about moved tags.
  /// Messages about lenses, readouts, prints and odometry that are not as configured.
  std::vector<std::string> mismatches;
  MapFit fit;
  BodiesReplay::LastRefinement last;
  bool is_level{true};  ///< The vertical is by an IMU or odometry; else a guess of the filter.
  double run_cpu_s{};
  double solve_cpu_s{};  ///< Of the last solution, of everything.
};

/// Delay for the samples of each recording, so that recordings without common time follow each
/// other in the given order. Those that overlap keep their offsets.
[[nodiscard]] std::vector<Duration> one_after_the_other(std::span<const MapBuildBody> bodies);

/// One map of several recordings: all bodies share one live map that is refined, and solved once
/// more at the end.
/// @param watch  gets the share of all data, and the progress
/// @return Error when a source is lost
[[nodiscard]] Expected<MapBuild> build_map(
    const std::vector<MapBuildBody>& bodies, OfflineMap map,
    const std::function<void(double share, const OfflineProgress&)>& watch = {});

}  // namespace fiducap
