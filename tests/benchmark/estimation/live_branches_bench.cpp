// Bodies without IMU, real recordings: what was given out live beside what is known after the last
// image. Nothing is fitted: both stand in the workspace as the product defines it.
#include <algorithm>
#include <filesystem>
#include <optional>

#include "base/quantile.hpp"
#include "base/so3.hpp"
#include "estimation/options.hpp"
#include "estimation/parallel.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::bench {

namespace {

// A live pose further off than this was no pose to be given out.
constexpr double kWrong_m = 0.1;
constexpr double kWrong_rad = 5 / kDegrees;
// Further off than this it was another planar pose of a tag, and not a map that still improved.
constexpr double kGross_m = 0.5;
constexpr double kGross_rad = 20 / kDegrees;
// Wrong poses with a pause of this length between them are two stretches.
constexpr Duration kPause = std::chrono::seconds(2);

struct Stretch {
  Instant begin{};
  Instant end{};
  [[nodiscard]] double seconds() const { return to_seconds(end - begin); }
};

struct Differences {
  std::vector<double> apart_m;
  std::vector<double> apart_rad;
  int wrong{0};
  int gross{0};
  Instant worst_at{};
  Stretch longest;
};

Differences compare(const std::vector<StampedPose>& live, const std::vector<StampedPose>& settled) {
  Differences out;
  double worst_m = -1;
  std::optional<Stretch> stretch;
  auto other = settled.begin();
  for (const StampedPose& pose : live) {
    other = std::lower_bound(other, settled.end(), pose.at,
                             [](const StampedPose& s, Instant at) { return s.at < at; });
    if (other == settled.end()) break;
    if (other->at != pose.at) continue;
    const double apart_m = (pose.X_WB.p - other->X_WB.p).norm();
    const double apart_rad = angle_between(pose.X_WB.q, other->X_WB.q);
    out.apart_m.push_back(apart_m);
    out.apart_rad.push_back(apart_rad);
    if (apart_m > worst_m) {
      worst_m = apart_m;
      out.worst_at = pose.at;
    }
    if (apart_m <= kWrong_m && apart_rad <= kWrong_rad) {
      stretch.reset();
      continue;
    }
    ++out.wrong;
    out.gross += apart_m > kGross_m || apart_rad > kGross_rad ? 1 : 0;
    if (!stretch || pose.at - stretch->end > kPause) stretch = Stretch{pose.at, pose.at};
    stretch->end = pose.at;
    if (stretch->seconds() >= out.longest.seconds()) out.longest = *stretch;
  }
  return out;
}

struct Job {
  std::string folder;
  std::string name;
  std::string error;
  OfflineResult result;
  Instant first{};
};

void run_one(Job& job, const EstimationOptions& options) {
  const auto info = read_recording_info(job.folder);
  if (!info) {
    job.error = info.error().text();
    return;
  }
  const FakeClock clock;
  auto source = open_recording(*info, {}, clock);
  if (!source) {
    job.error = source.error().text();
    return;
  }
  OfflineSetup setup = offline_setup(*info);
  setup.estimator = options.estimator;
  auto result = run_offline(setup, **source);
  if (!result) {
    job.error = result.error().text();
    return;
  }
  job.result = std::move(*result);
  if (!job.result.trajectory.empty()) job.first = job.result.trajectory.front().at;
}

std::vector<Cell> row_of(const Job& job) {
  const OfflineResult& run = job.result;
  const Differences d = compare(run.live, run.trajectory);
  const auto count = [](std::size_t n) { return Figure{static_cast<double>(n), 0}; };
  const auto compared = static_cast<double>(d.apart_m.size());
  const auto resets = std::count_if(run.events.begin(), run.events.end(), [](const auto& event) {
    return event.kind == BodyEvent::Kind::kReset;
  });
  const auto since = [&](Instant at) { return to_seconds(at - job.first); };
  const bool any = !d.apart_m.empty();
  return {
      job.name,
      count(run.trajectory.size()),
      count(run.live.size()),
      count(d.apart_m.size()),
      Figure{100 * d.wrong / compared, 2},
      Figure{kMm * quantile(d.apart_m, 0.5), 1},
      Figure{kDegrees * quantile(d.apart_rad, 0.5), 2},
      Figure{kMm * quantile(d.apart_m, 0.95), 1},
      Figure{any ? kMm * *std::max_element(d.apart_m.begin(), d.apart_m.end()) : Nees::kNone, 0},
      Figure{
          any ? kDegrees * *std::max_element(d.apart_rad.begin(), d.apart_rad.end()) : Nees::kNone,
          1},
      Figure{any ? since(d.worst_at) : Nees::kNone, 1},
      Figure{d.wrong > 0 ? d.longest.seconds() : 0.0, 1},
      Figure{d.wrong > 0 ? since(d.longest.begin) : Nees::kNone, 1},
      count(static_cast<std::size_t>(resets)),
      count(run.tags.size()),
      Figure{run.statistics.update_cpu_s, 2}};
}

}  // namespace

std::vector<Table> bench_live_branches(const EstimationOptions& options) {
  namespace fs = std::filesystem;
  Table table{"Real recordings without IMU: live poses against the settled ones at the same image",
              {"recording", "images settled", "live poses", "compared", "wrong %", "gross %",
               "median mm", "median deg", "95 % mm", "worst mm", "worst deg", "worst at s",
               "longest wrong s", "from s", "resets", "tags", "update cpu s"}};
  std::vector<Job> jobs;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(options.data, error)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_directory() || !name.starts_with("tagslam_")) continue;
    const bool is_wanted =
        options.classes.empty() ||
        std::find(options.classes.begin(), options.classes.end(), name) != options.classes.end();
    if (is_wanted) jobs.push_back({entry.path().string(), name, {}, {}, {}});
  }
  if (jobs.empty()) table.remarks.emplace_back("NOT RUN: no tagslam_* in " + options.data);
  std::sort(jobs.begin(), jobs.end(), [](const Job& a, const Job& b) {
    return std::pair(a.name.size(), a.name) < std::pair(b.name.size(), b.name);
  });
  in_parallel(static_cast<int>(jobs.size()), options.threads,
              [&](int i) { run_one(jobs[static_cast<std::size_t>(i)], options); });
  for (const Job& job : jobs) {
    if (job.error.empty()) {
      table.rows.push_back(row_of(job));
    } else {
      table.remarks.emplace_back("NOT RUN: " + job.name + ": " + job.error);
    }
  }
  table.remarks.emplace_back(
      "wrong: more than 5 deg or 10 cm off; gross: more than 20 deg or 50 cm. Nothing is fitted; "
      "seconds from the first settled "
      "image on.");
  return {table};
}

}  // namespace fiducap::bench
