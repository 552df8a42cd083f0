#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/gravity.hpp"
#include "pipeline/replay/map_build.hpp"
#include "tools/replay/evaluation.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct ReplayArguments {
  std::vector<std::string> recordings;
  std::string out;
  std::string config;
  std::string map;
  std::string store;   ///< Of a map: its newest version is the map at the start.
  std::string filter;  ///< Empty: the default of OfflineSetup.
  std::vector<std::string> sets;
  bool together{false};  ///< Several robots over one live map.
  bool resolve{false};   ///< Everything is solved for together after the last image.
  bool anyway{false};    ///< Also what the check calls unusable.
  bool plots{true};      ///< Also write plots.html.
  bool json{false};
};

/// `fiducap replay`. @return exit code
[[nodiscard]] int run_replay(const ReplayArguments& arguments, const Terminal& terminal);

struct CheckArguments {
  std::vector<std::string> recordings;
  bool json{false};
};

/// `fiducap check`: streams and faults of recordings. @return exit code
[[nodiscard]] int run_check(const CheckArguments& arguments, const Terminal& terminal);

struct EvaluateArguments {
  std::string tum;
  std::string recording;
  std::string plot;  ///< Page with plots, .html; empty: none.
  bool json{false};
};

/// `fiducap evaluate`. @return exit code
[[nodiscard]] int run_evaluate(const EvaluateArguments& arguments, const Terminal& terminal);

[[nodiscard]] std::string evaluation_text(const Evaluation& evaluation);
[[nodiscard]] std::string evaluation_json(const Evaluation& evaluation);

struct SimulateArguments {
  std::string out;
  std::string room{"hall"};
  double seconds{60};
  std::uint64_t seed{1};
  bool images{false};   ///< Render images …
  bool corners{false};  ///< … or write corners only; so also when neither is set.
  bool imu{true};
  double speed{1.0};
  double corner_noise_px{0.4};
  double gravity_m_s2{kUsualGravity_m_s2};  ///< The true one; it is not part of the recording.
  bool json{false};
};

/// `fiducap simulate`: a recording with truth. Its calibration is off by 5 mm and 0.5 degrees, in a
/// direction drawn by the seed; the true one is in truth/. @return exit code
[[nodiscard]] int run_simulate(const SimulateArguments& arguments, const Terminal& terminal);

struct MapBuildArguments {
  std::vector<std::string> recordings;
  std::string out;    ///< A file: .yaml, .csv; empty: none.
  std::string store;  ///< A map store; empty: none.
  std::string config;
  std::string map;  ///< Tags whose places are known.
  std::string filter;
  std::string comment;
  std::vector<std::string> sets;
  bool json{false};
};

/// `fiducap map build`: one map of several recordings. @return exit code; fails when no recording
/// has added a tag to the map
[[nodiscard]] int run_map_build(const MapBuildArguments& arguments, const Terminal& terminal);

/// The report on a map that was made of recordings.
struct MapBuildText {
  const MapBuild& build;
  const std::vector<std::string>& recordings;  ///< As they were given.
  int publish_sightings{};

  /// Tags, recordings, sigmas, fit.
  [[nodiscard]] std::string summary() const;
  /// What did not become part of the map, why, and its remedy: a sentence each.
  [[nodiscard]] std::vector<std::string> left_out() const;
  [[nodiscard]] std::string json() const;
};

/// Tags of the map that recordings have placed, not a survey.
[[nodiscard]] int tags_placed(const TagMap& map);

}  // namespace fiducap
