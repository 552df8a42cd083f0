// Bodies without IMU and with small tags: four corners allow two poses, which cannot be
// distinguished at first. Published poses of the wrong one, for how long, and the cost of waiting.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/numeric.hpp"
#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

using At = FilterRun::At;

// Poses with larger errors must not be published; with gross errors they are another planar pose of
// a tag.
constexpr double kWrong_m = 0.1;
constexpr double kWrong_rad = 5 / kDegrees;
constexpr double kGross_m = 0.5;
constexpr double kGross_rad = 20 / kDegrees;
constexpr double kThreeSigmas = 20.06;  // of six numbers
constexpr double kPause_s = 0.5;        // between two stretches of gross poses
constexpr double kSeconds = 30;
constexpr int kCamerasOfRig = 4;

struct Score {
  std::uint64_t seed{};
  int images{}, shown{}, wrong{}, gross{}, sure{};
  double longest_gross_s{};
  double first_shown_s{Nees::kNone};
  double median_m{Nees::kNone};
  int resets{};
};

/// Tags of 10 to 25 px, 2 to 4 m away: a walk through a hall of small prints, with errors of the
/// lens.
SimulatedDataSetup setup_of(const std::string& name, double seconds, std::uint64_t seed) {
  SimulatedDataSetup setup;
  setup.world = "hall";
  setup.seconds = seconds;
  setup.seed = seed;
  setup.has_imu = false;
  setup.cameras = name == "rig" ? kCamerasOfRig : 1;
  setup.tag_size_m = 0.12;
  setup.min_side_px = 10;
  setup.focal_error = 0.003;
  setup.centre_error_px = 1.5;
  return setup;
}

bool is_beyond(const At& at, double far_m, double far_rad) {
  return at.level_position_m > far_m || at.level_rotation_rad > far_rad;
}

Score score_of(const FilterRun& run, std::uint64_t seed) {
  Score score{.seed = seed, .images = run.frames, .resets = run.resets};
  std::vector<double> errors;
  double gross_since_s = 0;
  double gross_until_s = -kPause_s;
  for (const At& at : run.at) {
    if (!at.valid) continue;
    if (score.shown++ == 0) score.first_shown_s = at.t_s;
    errors.push_back(at.level_position_m);
    if (!is_beyond(at, kWrong_m, kWrong_rad)) continue;
    ++score.wrong;
    score.sure += at.nees.pose < kThreeSigmas ? 0 : 1;
    if (!is_beyond(at, kGross_m, kGross_rad)) continue;
    ++score.gross;
    if (at.t_s - gross_until_s >= kPause_s) gross_since_s = at.t_s;
    gross_until_s = at.t_s;
    score.longest_gross_s = std::max(score.longest_gross_s, gross_until_s - gross_since_s);
  }
  if (!errors.empty()) score.median_m = quantile(errors, 0.5);
  return score;
}

std::vector<double> known(const std::vector<Score>& scores, double Score::*figure) {
  std::vector<double> values;
  for (const Score& score : scores)
    if (!std::isnan(score.*figure)) values.push_back(score.*figure);
  return values;
}

double sum(const std::vector<Score>& scores, int Score::*figure) {
  double all = 0;
  for (const Score& score : scores) all += score.*figure;
  return all;
}

std::vector<Cell> row_of(const std::string& name, const std::vector<Score>& scores) {
  const auto count = [&](auto&& rule) {
    return std::to_string(std::count_if(scores.begin(), scores.end(), rule));
  };
  const double shown = sum(scores, &Score::shown);
  const std::vector<double> first = known(scores, &Score::first_shown_s);
  return cells(name, Figure{100 * sum(scores, &Score::wrong) / shown, 2},
               Figure{100 * sum(scores, &Score::sure) / shown, 2},
               Figure{100 * sum(scores, &Score::gross) / shown, 2},
               count([](const Score& s) { return s.gross > 0; }),
               Figure{largest(known(scores, &Score::longest_gross_s)), 1},
               Figure{100 * shown / sum(scores, &Score::images), 1},
               count([](const Score& s) { return s.shown == 0; }),
               Figure{first.empty() ? Nees::kNone : quantile(first, 0.5), 2},
               Figure{largest(first), 1},
               Figure{kMm * quantile(known(scores, &Score::median_m), 0.5), 1},
               static_cast<int>(sum(scores, &Score::resets)));
}

void print_each(const std::string& name, const std::vector<Score>& scores) {
  for (const Score& s : scores) {
    const double shown = std::max(1, s.shown);
    std::printf(
        "%s seed %d: shown %d of %d from %.2f s, wrong %.1f %%, sure %.1f %%, gross %.1f %% for "
        "%.1f s, median %.1f mm, %d resets\n",
        name.c_str(), static_cast<int>(s.seed), s.shown, s.images, s.first_shown_s,
        100 * s.wrong / shown, 100 * s.sure / shown, 100 * s.gross / shown, s.longest_gross_s,
        kMm * s.median_m, s.resets);
  }
}

}  // namespace

std::vector<Table> bench_branches(const EstimationOptions& options) {
  Table table{
      "Simulated bodies without IMU, tags of 10 to 25 px: poses that may be shown, against the "
      "truth",
      split("class|wrong %|wrong and > 3 sigma %|gross %|runs with gross|longest gross s|shown %|"
            "runs without|first shown s|latest s|median mm|resets")};
  for (const std::string& name : options.classes) {
    const auto scores = for_seeds(options, [&](std::uint64_t seed) {
      const double seconds = options.seconds > 0 ? options.seconds : kSeconds;
      FilterChoice choice = choice_of(options, "world", options.cases.front());
      choice.live = true;
      return score_of(run_filter(simulate(setup_of(name, seconds, seed)), choice), seed);
    });
    if (options.each) print_each(name, scores);
    table.rows.push_back(row_of(name, scores));
  }
  table.remarks.emplace_back(
      "Shares of the poses that may be shown. wrong: more than 5 deg or 10 cm off; gross: more "
      "than 20 deg or 50 cm. first shown: median over runs.");
  return {table};
}

}  // namespace fiducap::bench
