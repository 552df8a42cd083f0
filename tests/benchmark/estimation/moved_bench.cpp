// Tags that do not stay where the map has them, are there twice or printed wrongly: whether it is
// noticed, when, in which words, what is published meanwhile, and how the map heals. Three robots
// with the map graph; nothing false may be said.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "estimation/moved_case.hpp"
#include "estimation/parallel.hpp"
#include "pipeline/body_tracker.hpp"

namespace fiducap::bench {

namespace {

// After a tag was found again, so long its robots are looked at.
constexpr double kAfterwards_s = 5;
constexpr double kMostSigmas = 3;

/// Wrong words of a run, by what they are about.
struct FalseWords {
  int moved{};  ///< Quarantined, moved, disputed: of the map.
  int given_up{};
  int lens{};
  int size{};
  int imu{};
  int other{};
};

struct MovedRun {
  double sighted_s{Nees::kNone};  ///< The tag was first seen as it is wrong.
  double verdict_s{Nees::kNone};
  double healed_s{Nees::kNone};  ///< Found in its new place, or given up for good.
  double worst_before{};         ///< Of poses, error over 1-sigma, while all was well …
  double worst{};                ///< … and from the first sight on …
  double worst_m{};              ///< … then.
  double worst_s{};
  int poses{};                  ///< From the first sight on …
  int beyond{};                 ///< … further off than three sigmas.
  double place_m{Nees::kNone};  ///< Of the tag at the end …
  double place_sigmas{};        ///< … root of its NEES per degree of freedom.
  double others_m{};            ///< RMS of all others.
  FalseWords wrong;
  double robot_hours{};
  std::vector<std::string> said;
};

/// One run of a case, as it is listened to.
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
    const auto sigmas = estimate.covariance.diagonal().head<6>().cwiseSqrt();
    const BodyLimits limits;
    if (sigmas.head<3>().maxCoeff() > limits.max_position_sigma_m ||
        sigmas.tail<3>().maxCoeff() > limits.max_rotation_sigma_rad)
      return;
    const Pose truth = X_WR_ * one_.data[body].truth_near(estimate.at).X_WB;
    score((estimate.X_WB.p - truth.p).norm(), sigmas.head<3>().norm(), t_s);
  }

  void hear(const MapEvent& event, Instant at) {
    const double t_s = to_seconds(at - first_);
    const bool is_gone = event.kind == MapEvent::Kind::kTagQuarantined;
    const bool is_back = event.kind == MapEvent::Kind::kTagMoved;
    const bool is_disputed = event.kind == MapEvent::Kind::kTagDisputed;
    if (!is_gone && !is_back && !is_disputed) return;
    const bool is_last = event.text.find("not used any more") != std::string::npos;
    out_.said.push_back(fmt::format("{:.1f} s, map: {}", t_s, event.text));
    if (event.tag_id != one_.tag_id || t_s < one_.at_s) {
      ++(is_last ? out_.wrong.given_up : out_.wrong.moved);
      return;
    }
    if (std::isnan(out_.verdict_s)) out_.verdict_s = t_s;
    if (std::isnan(out_.healed_s) && (is_back || is_last)) out_.healed_s = t_s;
    // Found once more, it was not the end of it.
    if (is_gone && !is_last) out_.healed_s = Nees::kNone;
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
    out_.said.push_back(
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
    if (t_s >= out_.healed_s + kAfterwards_s) return;
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
  bool knows_of_it_;         ///< Somebody has seen the tag as it should be, if that matters.
  bool has_seen_it_{false};  ///< … as it is wrong.
};

/// A tag that is there twice, or swings, is right where it is nearest.
void score_tags(const TagMap& map, const MovedCase& one, MovedRun& out) {
  const Pose X_WR = workspace_of(one.data.front());
  const auto error = [&](const MapTag& tag, const Pose& X_RT) {
    const Pose truth = X_WR * X_RT;
    Vector6d e;
    e << tag.tag.X_WT.p - truth.p, log_so3(tag.tag.X_WT.q * truth.q.conjugate());
    return e;
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
      out.place_sigmas = std::sqrt(e.dot(tag.tag.covariance.ldlt().solve(e)) / 6);
    }
  }
  out.others_m = std::sqrt(square);
}

MovedRun run_one(const EstimationOptions& options, const std::string& name, std::uint64_t seed) {
  const MovedCase one = make_moved_case(options, name, seed);
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  choice.refine_period_s = kRefinePeriod_s;
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

std::string text_of(const FalseWords& wrong) {
  std::string out;
  const auto add = [&](const char* what, int count) {
    if (count > 0) out += fmt::format("{}{} {}", out.empty() ? "" : ", ", count, what);
  };
  add("moved", wrong.moved);
  add("given up", wrong.given_up);
  add("lens", wrong.lens);
  add("size", wrong.size);
  add("imu", wrong.imu);
  add("other", wrong.other);
  return out.empty() ? "0" : out;
}

std::vector<Cell> row_of(const std::string& name, std::uint64_t seed, const MovedRun& run) {
  return {name,
          std::to_string(seed),
          Figure{run.sighted_s, 1},
          Figure{run.verdict_s - run.sighted_s, 2},
          Figure{run.healed_s - run.sighted_s, 2},
          Figure{run.worst, 2},
          Figure{kMm * run.worst_m, 1},
          Figure{run.worst_s, 1},
          fmt::format("{}/{}", run.beyond, run.poses),
          Figure{run.worst_before, 2},
          Figure{kMm * run.place_m, 1},
          Figure{run.place_sigmas, 2},
          Figure{kMm * run.others_m, 2},
          text_of(run.wrong),
          Figure{run.robot_hours, 3}};
}

}  // namespace

std::vector<Table> bench_moved(const EstimationOptions& options) {
  Table table{
      fmt::format("Tags that do not stay, seeds {} to {}", options.first_seed,
                  options.first_seed + static_cast<std::uint64_t>(options.seeds) - 1),
      {"case", "seed", "seen at s", "verdict after s", "healed after s", "worst sigmas", "/mm",
       "/at s", "beyond 3", "before", "tag mm", "/sigmas", "others mm", "false", "robot hours"}};
  for (const std::string& name : options.classes) {
    std::vector<MovedRun> runs(static_cast<std::size_t>(options.seeds));
    in_parallel(options.seeds, options.threads, [&](int i) {
      runs[static_cast<std::size_t>(i)] =
          run_one(options, name, options.first_seed + static_cast<std::uint64_t>(i));
    });
    for (std::size_t i = 0; i < runs.size(); ++i) {
      table.rows.push_back(row_of(name, options.first_seed + i, runs[i]));
      for (const std::string& text : runs[i].said)
        table.remarks.push_back(fmt::format("{} {}: {}", name, options.first_seed + i, text));
    }
  }
  table.remarks.emplace_back(
      "`seen`: the first image of a placed robot that shows the tag elsewhere or, when it is there "
      "twice, its other print. `verdict`: the first word about this tag, by map or robot; "
      "`healed`: it is used where it is now, or given up for good. `worst`: a pose's error over "
      "its 1-sigma (both of three axes together), from then until 5 s after healing; `beyond 3`: "
      "of how many poses; `before`: the worst until then, in a clean run of all. `tag`: at the "
      "end; `sigmas`: root of its NEES per degree of freedom. `false`: words about other tags or "
      "numbers, or too early.");
  return {table};
}

}  // namespace fiducap::bench
