#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "pipeline/replay/map_build.hpp"
#include "pipeline/replay/recording_check.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

/// What a run takes from elsewhere than its recordings.
struct SetupArguments {
  std::string config{};
  std::string map{};     ///< Tags whose places are known.
  std::string filter{};  ///< Empty: the default of OfflineSetup.
  std::vector<std::string> sets{};
};

struct ReplayArguments : SetupArguments {
  std::vector<std::string> recordings;
  std::string out;
  std::string store;     ///< Of a map: its newest version is the map at the start.
  bool together{false};  ///< Several robots over one live map.
  bool resolve{false};   ///< Everything is solved for together after the last image.
  bool anyway{false};    ///< Also what the check calls unusable.
  bool plots{true};      ///< Also write plots.html.
  bool json{false};
};

/// `fiducap replay`. @return exit code
[[nodiscard]] int run_replay(const ReplayArguments& arguments, const Terminal& terminal);

// ---- Inputs of runs.

void print_findings(const Terminal& terminal, const std::vector<RecordingFinding>& findings);
[[nodiscard]] nlohmann::ordered_json findings_json(const std::vector<RecordingFinding>& findings);

/// Writes the findings of check_recording() to `terminal.err`.
/// @return the report; Error with the likeliest cause when the recording is unusable
[[nodiscard]] Expected<RecordingReport> require_usable(const RecordingInfo& info,
                                                       const Terminal& terminal);

/// Setup for a replay of `info`: the recording's own sizes and tags, over them the keys that
/// --config and --set contain, and the tags of --map as inputs.
[[nodiscard]] Expected<OfflineSetup> replay_setup(const SetupArguments& arguments,
                                                  const RecordingInfo& info);

/// Whether --config or --set contain `section.key`; the recording or the verb has the values of
/// keys that they do not contain. @pre the file can be read
[[nodiscard]] bool is_mentioned(const SetupArguments& arguments, const std::string& section,
                                const std::string& key);

/// --config and --set. @return Error with the first fault
[[nodiscard]] Expected<ServerConfig> config_of(const SetupArguments& arguments);

/// One robot of a replay.
struct ReplayInput {
  RecordingInfo info;
  OfflineSetup setup;
  std::unique_ptr<SensorSource> source;
  Instant first{Instant::max()};  ///< Of all its streams; after `last`: not known.
  Instant last{Instant::min()};

  void take_span(const RecordingReport& report);
};

/// Opens the samples of a recording.
[[nodiscard]] Expected<ReplayInput> open_input(RecordingInfo info, OfflineSetup setup);

/// All robots of a replay and what they share.
struct ReplayInputs {
  std::vector<ReplayInput> bodies;
  OfflineMap map;
  bool is_session{false};
};

/// Opens the recordings, or the session of a live server (SessionRecorder), that the arguments
/// name.
[[nodiscard]] Expected<ReplayInputs> read_replay_inputs(const ReplayArguments& arguments);

/// Reports the faults of the recordings and sets their spans. Recordings of a session are replayed
/// with their faults.
/// @return Error when one cannot be used
[[nodiscard]] Expected<void> check_replay_inputs(const ReplayArguments& arguments,
                                                 ReplayInputs& inputs, const Terminal& terminal);

// ---- Of `fiducap map build`.

/// The report on a map that was made of recordings.
struct MapBuildText {
  const MapBuild& build;
  const std::vector<std::string>& recordings;  ///< As they were given.
  int publish_sightings{};

  /// Tags, recordings, sigmas, fit.
  [[nodiscard]] std::string summary() const;
  /// What did not become part of the map, why, and its remedy: a sentence each.
  [[nodiscard]] std::vector<std::string> left_out() const;
  [[nodiscard]] nlohmann::ordered_json json() const;
};

/// Tags of the map that recordings have placed, not a survey.
[[nodiscard]] int tags_placed(const TagMap& map);

}  // namespace fiducap
