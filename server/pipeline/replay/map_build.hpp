#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "pipeline/replay/offline_run.hpp"

namespace fiducap {

/// One recording of those that a map is made of.
struct MapBuildBody {
  OfflineBody body;
  Instant first{};  ///< Stamp of its first sample …
  Instant last{};   ///< … and of its last.
};

/// What became of one recording.
struct BuiltRecording {
  int images{};
  int images_with_tags{};
  std::map<int, int> seen;  ///< In how many images, by tag id.
  int segments{};           ///< Of about a second, that the graph could use …
  int segments_in_map{};    ///< … and of those the ones that hang together with the map.
};

/// What hangs together, but not with the map: no tag says how it lies.
struct MapPart {
  std::vector<std::size_t> recordings;
  std::vector<int> tag_ids;
  std::vector<int> also_in_map;  ///< Of these; they did not say the same, or not enough.
  int segments{};
};

/// How well everything fits together.
struct MapFit {
  double chi_square_per_number{};  ///< 1: as the noises say.
  int sightings{};
  int outliers{};  ///< That pull at less than half their weight.
};

struct MapBuild {
  TagMap map;
  std::vector<BuiltRecording> recordings;
  std::vector<MapPart> apart;
  std::map<int, int> seen_too_seldom;  ///< Sightings of tags that hang on the map all the same.
  std::vector<std::string> moved;  ///< What the map found out about tags that left their places.
  /// What all of it together says of lenses, readouts, prints and odometry not as configured.
  std::vector<std::string> mismatches;
  MapFit fit;
  BodiesReplay::LastRefinement last;
  bool is_level{true};  ///< An IMU or odometry knows what is up; else the filter guesses.
  double run_cpu_s{};
  double solve_cpu_s{};  ///< The last time, over everything.
};

/// How far it is: a share of all data, then the rounds of the last solution.
struct MapBuildProgress {
  double share{};
  int round{};  ///< 0: still reading.
  std::size_t tags{};
};

/// How much later the samples of each are to be taken, for recordings that have no time in common
/// to come one after the other as they are given. Those that overlap stay as they are.
[[nodiscard]] std::vector<Duration> one_after_the_other(std::span<const MapBuildBody> bodies);

/// One map of several recordings: all bodies over one live map that is refined, and once more over
/// everything at the end.
/// @pre map.config.refine_period_s > 0
/// @return Error when a source is lost
[[nodiscard]] Expected<MapBuild> build_map(
    const std::vector<MapBuildBody>& bodies, const OfflineMap& map,
    const std::function<void(const MapBuildProgress&)>& progress = {});

}  // namespace fiducap
