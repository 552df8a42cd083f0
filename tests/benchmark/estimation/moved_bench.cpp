// Tags that move, exist twice or are printed wrongly: whether and when it is reported, the
// published poses until then, and the repair of the map. Three robots with the map graph; no report
// may be false.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "estimation/moved_case.hpp"

namespace fiducap::bench {

namespace {

// Poses are scored until this time after the repair.
constexpr double kAfterwards_s = 5;
constexpr double kMostSigmas = 3;

/// False reports of a run, by subject.
struct FalseReports {
  int moved{};  ///< Of the map: quarantined, moved, inconsistent.
  int given_up{};
  int lens{};
  int size{};
  int imu{};
  int other{};
};

struct MovedRun {
  double sighted_s{Nees::kNone};  ///< The fault of the tag was first seen.
  double verdict_s{Nees::kNone};
  double repaired_s{Nees::kNone};  ///< Found in its new place, or given up finally.
  double worst_before{};           ///< Of poses, error over 1-sigma, without the fault …
  double worst{};                  ///< … and since it was seen …
  double worst_m{};                ///< … with this error.
  double worst_s{};
  int poses{};                  ///< Since the fault was seen …
  int beyond{};                 ///< … with errors above three sigmas.
  double place_m{Nees::kNone};  ///< Of the tag at the end …
  double place_sigmas{};        ///< … root of its NEES per degree of freedom.
  double others_m{};            ///< RMS of all others.
  FalseReports wrong;
  double robot_hours{};
  std::vector<std::string> reports;
};

/// One run of a case.
class MovedWatch final {
 public:
  MovedWatch(const MovedCase& one, MovedRun& out)
      : one_(one),
        out_(out),
        X_WR_(workspace_of(one.data.front())),
        first_(time_of(one.data.front().samples.front())),
        knows_of_it_(!one.is_twice || one.start.has_value()) {}

  void take(std::size_t body, const BodyUpdate& update) {
    const double t_s = to_seconds(update.seen.exposed_at - first_);
    if (update.is_placed()) note_sight(body, update.seen, t_s);
    for (const BodyEvent& event : update.events) hear(body, event, t_s);
    if (!update.is_placed() || t_s < kSettled_s) return;
    const BodyEstimate& estimate = *update.estimate;
    if (!may_be_shown(estimate.covariance)) return;
    const Pose truth = X_WR_ * one_.data[body].truth_near(estimate.at).X_WB;
    score((estimate.X_WB.p - truth.p).norm(),
          std::sqrt(estimate.covariance.diagonal().head<3>().sum()), t_s);
  }

  void hear(const MapEvent& event, Instant at) {
    const double t_s = to_seconds(at - first_);
    const bool is_gone = event.kind == MapEvent::Kind::kTagQuarantined;
    const bool is_back = event.kind == MapEvent::Kind::kTagMoved;
    const bool is_disputed = event.kind == MapEvent::Kind::kTagDisputed;
    if (!is_gone && !is_back && !is_disputed) return;
    const bool is_last = event.text.find("not used any more") != std::string::npos;
    out_.reports.push_back(fmt::format("{:.1f} s, map: {}", t_s, event.text));
    if (event.tag_id != one_.tag_id || t_s < one_.at_s) {
      ++(is_last ? out_.wrong.given_up : out_.wrong.moved);
      return;
    }
    if (std::isnan(out_.verdict_s)) out_.verdict_s = t_s;
    if (std::isnan(out_.repaired_s) && (is_back || is_last)) out_.repaired_s = t_s;
    // Quarantined again.
    if (is_gone && !is_last) out_.repaired_s = Nees::kNone;
  }

 private:
  void note_sight(std::size_t body, const TagObservations& seen, double t_s) {
    const bool sees = std::any_of(seen.tags.begin(), seen.tags.end(),
                                  [&](const auto& t) { return t.tag_id == one_.tag_id; });
    if (!sees) return;
    const bool is_wrong = one_.elsewhere[body].contains(seen.exposed_at);
    (is_wrong ? has_seen_it_ : knows_of_it_) = true;
    if (has_seen_it_ && knows_of_it_ && std::isnan(out_.sighted_s)) out_.sighted_s = t_s;
  }

  void hear(std::size_t body, const BodyEvent& event, double t_s) {
    int* count = nullptr;
    switch (event.kind) {
      case BodyEvent::Kind::kMismatch:
      case BodyEvent::Kind::kDoubt:
        count = about(event.text);
        break;
      case BodyEvent::Kind::kImuSilent:
      case BodyEvent::Kind::kImuUnusable:
      case BodyEvent::Kind::kImuDoubtful:
      case BodyEvent::Kind::kTurnsDisagree:
      case BodyEvent::Kind::kClockJumped:
        count = &out_.wrong.imu;
        break;
      default:
        return;
    }
    out_.reports.push_back(
        fmt::format("{:.1f} s, robot {}: {}: {}", t_s, body + 1, name_of(event.kind), event.text));
    const std::string it = "tag " + std::to_string(one_.tag_id) + " ";
    const bool is_of_it = one_.tag_id >= 0 && event.text.find(it) != std::string::npos;
    if (!is_of_it) ++*count;
    if (is_of_it && std::isnan(out_.verdict_s)) out_.verdict_s = t_s;
  }

  [[nodiscard]] int* about(const std::string& text) const {
    const auto has = [&](const char* word) { return text.find(word) != std::string::npos; };
    if (text.starts_with("camera")) return &out_.wrong.lens;
    if (has("larger") || has("smaller") || has("configured size")) return &out_.wrong.size;
    return text.starts_with("the ") ? &out_.wrong.imu : &out_.wrong.other;
  }

  void score(double error_m, double sigma_m, double t_s) {
    const double ratio = error_m / sigma_m;
    if (std::isnan(out_.sighted_s)) {
      out_.worst_before = std::max(out_.worst_before, ratio);
      return;
    }
    if (t_s >= out_.repaired_s + kAfterwards_s) return;
    ++out_.poses;
    out_.beyond += ratio > kMostSigmas ? 1 : 0;
    if (ratio <= out_.worst) return;
    out_.worst = ratio;
    out_.worst_m = error_m;
    out_.worst_s = t_s;
  }

  const MovedCase& one_;
  MovedRun& out_;
  Pose X_WR_;
  Instant first_;
  bool knows_of_it_;         ///< A robot has seen the tag in its place, if that matters.
  bool has_seen_it_{false};  ///< … elsewhere.
};

/// A tag with several places, or on a door, is compared with the nearest.
void score_tags(const TagMap& map, const MovedCase& one, MovedRun& out) {
  const Pose X_WR = workspace_of(one.data.front());
  const auto error = [&](const MapTag& tag, const Pose& X_RT) {
    return pose_error(tag.tag.X_WT, X_WR * X_RT);
  };
  double square = 0;
  for (const MapTag& tag : map.tags) {
    if (tag.tag.tag_id != one.tag_id) {
      const auto e = error(tag, one.data.front().tag(tag.tag.tag_id)->X_WT);
      square += e.head<3>().squaredNorm() / static_cast<double>(map.tags.size() - 1);
      continue;
    }
    if (tag.state == TagState::kQuarantined) continue;
    for (const Pose& X_RT : one.places) {
      const Vector6d e = error(tag, X_RT);
      if (!std::isnan(out.place_m) && e.head<3>().norm() > out.place_m) continue;
      out.place_m = e.head<3>().norm();
      out.place_sigmas = std::sqrt(normalised(e, tag.tag.covariance) / 6);
    }
  }
  out.others_m = std::sqrt(square);
}

MovedRun run_one(const EstimationOptions& options, const std::string& name, std::uint64_t seed) {
  const MovedCase one = make_moved_case(options, name, seed);
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  choice.start = one.start;
  choice.frozen = one.start.has_value();
  MovedRun out;
  MovedWatch watch(one, out);
  choice.listen = [&](std::size_t body, const BodyUpdate& update, const TagMap&) {
    watch.take(body, update);
  };
  choice.hear = [&](const MapEvent& event, Instant at) { watch.hear(event, at); };
  const TogetherRun run = run_together(one.data, choice);
  score_tags(run.map, one, out);
  for (const FilterRun& body : run.bodies) out.robot_hours += body.seconds / 3600;
  return out;
}

std::string text_of(const FalseReports& wrong) {
  const std::pair<const char*, int> counts[] = {
      {"moved", wrong.moved}, {"given up", wrong.given_up}, {"lens", wrong.lens},
      {"size", wrong.size},   {"imu", wrong.imu},           {"other", wrong.other}};
  std::string out;
  for (const auto& [what, count] : counts)
    if (count > 0) out += fmt::format("{}{} {}", out.empty() ? "" : ", ", count, what);
  return out.empty() ? "0" : out;
}

std::vector<Cell> row_of(const std::string& name, std::uint64_t seed, const MovedRun& run) {
  return cells(name, seed, Figure{run.sighted_s, 1}, Figure{run.verdict_s - run.sighted_s, 2},
               Figure{run.repaired_s - run.sighted_s, 2}, Figure{run.worst, 2},
               Figure{kMm * run.worst_m, 1}, Figure{run.worst_s, 1},
               fmt::format("{}/{}", run.beyond, run.poses), Figure{run.worst_before, 2},
               Figure{kMm * run.place_m, 1}, Figure{run.place_sigmas, 2},
               Figure{kMm * run.others_m, 2}, text_of(run.wrong), Figure{run.robot_hours, 3});
}

}  // namespace

std::vector<Table> bench_moved(const EstimationOptions& options) {
  Table table{
      fmt::format("Moved tags, seeds {} to {}", options.first_seed, options.last_seed()),
      split("case|seed|seen at s|verdict after s|repaired after s|worst sigmas|/mm|/at s|beyond 3|"
            "before|tag mm|/sigmas|others mm|false|robot hours")};
  for (const std::string& name : options.classes) {
    const auto runs =
        for_seeds(options, [&](std::uint64_t seed) { return run_one(options, name, seed); });
    for (std::size_t i = 0; i < runs.size(); ++i) {
      table.rows.push_back(row_of(name, options.first_seed + i, runs[i]));
      for (const std::string& text : runs[i].reports)
        table.remarks.push_back(fmt::format("{} {}: {}", name, options.first_seed + i, text));
    }
  }
  table.remarks.emplace_back(
      "`seen`: the first image of a placed robot that shows the tag elsewhere or, when it exists "
      "twice, its other print. `verdict`: the first report of this tag, by map or robot; "
      "`repaired`: it is used in its present place, or given up finally. `worst`: error of a pose "
      "over its 1-sigma (both of three axes together), from then until 5 s after the repair; "
      "`beyond 3`: of how many poses; `before`: the worst until then, in a clean run of all. "
      "`tag`: at the end; `sigmas`: root of its NEES per degree of freedom. `false`: reports of "
      "other tags or numbers, or too early.");
  return {table};
}

}  // namespace fiducap::bench
