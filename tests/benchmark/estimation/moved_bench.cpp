// Tags that do not stay where the map has them: whether it is noticed, when, what is published
// meanwhile, and how the map heals. Robots on a ring with the map graph; nothing false may be said.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/so3.hpp"
#include "estimation/options.hpp"
#include "estimation/parallel.hpp"
#include "simulation/mismatch_changes.hpp"

namespace fiducap::bench {

namespace {

constexpr std::uint64_t kNextRobot = 10'000;
constexpr double kSeconds = 120;
constexpr double kRefine_s = 2;
constexpr double kShareOfThree = 0.45;
constexpr double kPrintLarger = 1.05;
// After a tag was found again, so long its robots are looked at.
constexpr double kAfterwards_s = 5;

struct MovedRun {
  double sighted_s{Nees::kNone};  ///< The tag was first seen in its new place.
  double verdict_s{Nees::kNone};
  double healed_s{Nees::kNone};
  double worst_before{};        ///< Of poses, error over 1-sigma, while all was well …
  double worst{};               ///< … and from the first sight on …
  double worst_m{};             ///< … then.
  double place_m{Nees::kNone};  ///< Of the tag at the end …
  double place_sigmas{};        ///< … root of its NEES per degree of freedom.
  double others_m{};            ///< RMS of all others.
  int false_verdicts{};
  double robot_hours{};
  std::vector<std::string> said;  ///< Of the map.
};

struct MovedCase {
  std::vector<EstimationData> data;
  int tag_id{-1};
  double at_s{};
  Eigen::Vector3d by_m{Eigen::Vector3d::Zero()};
};

Eigen::Vector3d direction(std::uint64_t seed) {
  std::mt19937_64 random(seed * 31 + 7);
  std::normal_distribution<double> gauss;
  const double x = gauss(random);
  const double y = gauss(random);
  return Eigen::Vector3d(x, y, gauss(random)).normalized();
}

/// @param name  metres by which the tag is moved, or what is wrong with it
MovedCase make_case(const EstimationOptions& options, const std::string& name, std::uint64_t seed) {
  MovedCase out;
  const double seconds = options.seconds > 0 ? options.seconds : kSeconds;
  const bool is_move = name.front() == '0';
  const int robots = is_move || name == "clean" ? 3 : 1;
  std::vector<SimulatedDataSetup> setups;
  for (int k = 0; k < robots; ++k) {
    SimulatedDataSetup setup;
    setup.world = "ring";
    setup.seconds = seconds;
    setup.seed = seed + kNextRobot * static_cast<std::uint64_t>(k);
    setup.from = static_cast<double>(k) / robots;
    setup.share = robots == 3 ? kShareOfThree : 0.25;
    setups.push_back(setup);
    out.data.push_back(simulate(setup));
  }
  out.at_s = seconds / 2;
  if (name != "clean") out.tag_id = most_seen_tag(out.data.front());
  if (is_move) {
    out.by_m = std::stod(name) * direction(seed);
    for (int k = 0; k < robots; ++k) {
      auto& setup = setups[static_cast<std::size_t>(k)];
      setup.faults.moved_tag = out.tag_id;
      setup.faults.moved_at_s = out.at_s;
      setup.faults.moved_by_m = out.by_m;
      out.data[static_cast<std::size_t>(k)] = simulate(setup);
    }
  }
  if (name == "twice") mismatch::print_again(out.data.front(), out.tag_id, seed);
  if (name == "door") mismatch::hang_on_door(out.data.front(), out.tag_id, out.at_s, seed);
  if (name == "size") mismatch::print_larger(out.data.front(), kPrintLarger, out.tag_id);
  if (name == "twice" || name == "size") out.at_s = 0;
  for (EstimationData& one : out.data) one.reference_tag = out.data.front().reference_tag;
  return out;
}

void score_tags(const TagMap& map, const MovedCase& one, MovedRun& out) {
  const Pose X_WR = workspace_of(one.data.front());
  double square = 0;
  for (const MapTag& tag : map.tags) {
    Pose truth = one.data.front().tag(tag.tag.tag_id)->X_WT;
    const bool is_it = tag.tag.tag_id == one.tag_id;
    if (is_it) truth.p += one.by_m;
    truth = X_WR * truth;
    Vector6d e;
    e << tag.tag.X_WT.p - truth.p, log_so3(tag.tag.X_WT.q * truth.q.conjugate());
    if (is_it && tag.state != TagState::kQuarantined) {
      out.place_m = e.head<3>().norm();
      out.place_sigmas = std::sqrt(e.dot(tag.tag.covariance.ldlt().solve(e)) / 6);
    }
    if (!is_it) square += e.head<3>().squaredNorm() / static_cast<double>(map.tags.size() - 1);
  }
  out.others_m = std::sqrt(square);
}

MovedRun run_one(const EstimationOptions& options, const std::string& name, std::uint64_t seed) {
  const MovedCase one = make_case(options, name, seed);
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  choice.refine_period_s = kRefine_s;
  MovedRun out;
  const Pose X_WR = workspace_of(one.data.front());
  const Instant first = time_of(one.data.front().samples.front());
  choice.listen = [&](std::size_t body, const BodyUpdate& update, const TagMap&) {
    const double t_s = to_seconds(update.seen.exposed_at - first);
    const bool sees = std::any_of(update.seen.tags.begin(), update.seen.tags.end(),
                                  [&](const auto& t) { return t.tag_id == one.tag_id; });
    if (sees && t_s >= one.at_s && std::isnan(out.sighted_s) && update.is_placed())
      out.sighted_s = t_s;
    if (!update.is_placed() || t_s < kSettled_s) return;
    const Pose truth = X_WR * one.data[body].truth_near(update.estimate->at).X_WB;
    const Eigen::Vector3d e = update.estimate->X_WB.p - truth.p;
    const double sigma_m = std::sqrt(update.estimate->covariance.topLeftCorner<3, 3>().trace());
    const double ratio = e.norm() / sigma_m;
    if (std::isnan(out.sighted_s)) {
      out.worst_before = std::max(out.worst_before, ratio);
    } else if (std::isnan(out.healed_s) || t_s < out.healed_s + kAfterwards_s) {
      if (ratio > out.worst) out.worst_m = e.norm();
      out.worst = std::max(out.worst, ratio);
    }
  };
  choice.hear = [&](const MapEvent& event, Instant at) {
    const double t_s = to_seconds(at - first);
    const bool is_gone = event.kind == MapEvent::Kind::kTagQuarantined;
    const bool is_back = event.kind == MapEvent::Kind::kTagMoved;
    const bool is_disputed = event.kind == MapEvent::Kind::kTagDisputed;
    if (!is_gone && !is_back && !is_disputed) return;
    out.said.push_back(fmt::format("{:.1f} s: {}", t_s, event.text));
    if (event.tag_id != one.tag_id || t_s < one.at_s) {
      ++out.false_verdicts;
    } else if (is_gone && std::isnan(out.verdict_s)) {
      out.verdict_s = t_s;
    } else if (is_back && std::isnan(out.healed_s)) {
      out.healed_s = t_s;
    }
  };
  const TogetherRun run = run_together(one.data, choice);
  score_tags(run.map, one, out);
  for (const FilterRun& body : run.bodies) out.robot_hours += body.seconds / 3600;
  return out;
}

}  // namespace

std::vector<Table> bench_moved(const EstimationOptions& options) {
  Table table{fmt::format("Tags that do not stay, seeds {} to {}", options.first_seed,
                          options.first_seed + static_cast<std::uint64_t>(options.seeds) - 1),
              {"case", "seed", "seen at s", "verdict after s", "healed after s", "worst sigmas",
               "/mm", "before", "tag mm", "/sigmas", "others mm", "false", "robot hours"}};
  for (const std::string& name : options.classes) {
    std::vector<MovedRun> runs(static_cast<std::size_t>(options.seeds));
    in_parallel(options.seeds, options.threads, [&](int i) {
      runs[static_cast<std::size_t>(i)] =
          run_one(options, name, options.first_seed + static_cast<std::uint64_t>(i));
    });
    for (std::size_t i = 0; i < runs.size(); ++i) {
      const MovedRun& run = runs[i];
      table.rows.push_back(
          {name, std::to_string(options.first_seed + i), Figure{run.sighted_s, 1},
           Figure{run.verdict_s - run.sighted_s, 2}, Figure{run.healed_s - run.sighted_s, 2},
           Figure{run.worst, 2}, Figure{kMm * run.worst_m, 1}, Figure{run.worst_before, 2},
           Figure{kMm * run.place_m, 1}, Figure{run.place_sigmas, 2}, Figure{kMm * run.others_m, 2},
           std::to_string(run.false_verdicts), Figure{run.robot_hours, 3}});
      for (const std::string& text : run.said)
        table.remarks.push_back(fmt::format("{} {}: {}", name, options.first_seed + i, text));
    }
  }
  table.remarks.emplace_back(
      "`verdict`, `healed`: from the first image of a placed robot that shows the tag elsewhere. "
      "`worst`: a pose's error over its 1-sigma (both of three axes together), from then until 5 s "
      "after healing; `before`: until then. `tag`: at the end; `sigmas`: root of its NEES per "
      "degree "
      "of freedom. `false`: verdicts about other tags, or too early.");
  return {table};
}

}  // namespace fiducap::bench
