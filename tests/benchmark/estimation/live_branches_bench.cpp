// Bodies without IMU, real recordings: published live poses beside the settled ones after the last
// image. Nothing is fitted: both are in the workspace as the product defines it.
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "estimation/options.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::bench {

namespace {

// Poses with larger errors must not be published.
constexpr double kWrong_m = 0.1;
constexpr double kWrong_rad = 5 / kDegrees;
// Gross errors are another planar pose of a tag, not a map that still improves.
constexpr double kGross_m = 0.5;
constexpr double kGross_rad = 20 / kDegrees;
constexpr double kThreeSigmas = 20.06;  // chi-square of six numbers with a probability of 99.73 %
constexpr Duration kPause = std::chrono::seconds(2);  // between two stretches of wrong poses

struct Stretch {
  Instant begin{};
  Instant end{};
  [[nodiscard]] double seconds() const { return to_seconds(end - begin); }
};

struct Differences {
  std::vector<double> apart_m;
  std::vector<double> apart_rad;
  int shown{0};        ///< Within BodyLimits: valid …
  int shown_wrong{0};  ///< … and wrong.
  int shown_gross{0};
  int wrong{0};
  int gross{0};
  int beyond_sigma{0};        ///< Errors above three stated sigmas …
  int wrong_beyond_sigma{0};  ///< … and wrong.
  int wrong_shape{0};         ///< Wrong also when all live poses are moved together.
  Instant worst_at{};
  Stretch longest;
};

/// A live pose with its covariance, and the settled one of the same image.
struct Pair {
  Instant at{};
  Pose live;
  Pose settled;
  Matrix6d covariance;
};

/// Published poses only: those of an anchored body.
std::vector<Pair> pairs_of(const OfflineResult& run) {
  std::vector<Pair> pairs;
  const auto anchored =
      std::find_if(run.events.begin(), run.events.end(),
                   [](const BodyEvent& event) { return event.kind == BodyEvent::Kind::kAnchored; });
  if (anchored == run.events.end()) return pairs;
  auto other = run.trajectory.begin();
  for (std::size_t i = 0; i < run.live.size(); ++i) {
    const StampedPose& pose = run.live[i];
    other = std::lower_bound(other, run.trajectory.end(), pose.at,
                             [](const StampedPose& s, Instant at) { return s.at < at; });
    if (other == run.trajectory.end()) break;
    if (other->at != pose.at || pose.at < anchored->at) continue;
    pairs.push_back({pose.at, pose.X_WB, other->X_WB, run.covariances[i].covariance});
  }
  return pairs;
}

bool is_wrong(const Pose& live, const Pose& settled) {
  return (live.p - settled.p).norm() > kWrong_m || angle_between(live.q, settled.q) > kWrong_rad;
}

bool is_beyond_sigma(const Pair& pair) {
  const Matrix6d P = pair.covariance + 1e-12 * Matrix6d::Identity();
  return !(normalised(pose_error(pair.settled, pair.live), P) < kThreeSigmas);
}

/// The shift of all live poses together that brings most of them to the settled ones.
Pose common_shift(const std::vector<Pair>& pairs) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Pair& pair : pairs)
    sum += (pair.settled.q * pair.live.q.conjugate()).toRotationMatrix();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Pose shift;
  shift.q = Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose()));
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> apart;
    for (const Pair& pair : pairs) apart.push_back((pair.settled.p - shift.q * pair.live.p)(axis));
    shift.p(axis) = quantile(std::move(apart), 0.5);
  }
  return shift;
}

Differences compare(const OfflineResult& run) {
  Differences out;
  double worst_m = -1;
  std::optional<Stretch> stretch;
  const std::vector<Pair> pairs = pairs_of(run);
  const Pose shift = pairs.empty() ? Pose{} : common_shift(pairs);
  for (const Pair& pose : pairs) {
    const double apart_m = (pose.live.p - pose.settled.p).norm();
    const double apart_rad = angle_between(pose.live.q, pose.settled.q);
    const bool is_beyond = is_beyond_sigma(pose);
    const bool is_shown = may_be_shown(pose.covariance);
    const bool is_gross = apart_m > kGross_m || apart_rad > kGross_rad;
    out.shown += is_shown ? 1 : 0;
    out.shown_wrong += is_shown && is_wrong(pose.live, pose.settled) ? 1 : 0;
    out.shown_gross += is_shown && is_gross ? 1 : 0;
    out.beyond_sigma += is_beyond ? 1 : 0;
    out.wrong_shape += is_wrong(shift * pose.live, pose.settled) ? 1 : 0;
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
    out.wrong_beyond_sigma += is_beyond ? 1 : 0;
    out.gross += is_gross ? 1 : 0;
    if (!stretch || pose.at - stretch->end > kPause) stretch = Stretch{pose.at, pose.at};
    stretch->end = pose.at;
    if (stretch->seconds() >= out.longest.seconds()) out.longest = *stretch;
  }
  return out;
}

struct Job {
  std::string folder;
  std::string name;
  Expected<OfflineResult> result{};
};

Expected<OfflineResult> run_one(const std::string& folder, const EstimationOptions& options) {
  const auto info = read_recording_info(folder);
  if (!info) return tl::unexpected(info.error());
  const FakeClock clock;
  auto source = open_recording(*info, {}, clock);
  if (!source) return tl::unexpected(source.error());
  OfflineSetup setup = offline_setup(*info);
  setup.estimator = options.estimator;
  return run_offline(setup, **source);
}

std::vector<Cell> row_of(const Job& job) {
  const OfflineResult& run = *job.result;
  const Differences d = compare(run);
  const Instant first = run.trajectory.empty() ? Instant{} : run.trajectory.front().at;
  const auto count = [](std::size_t n) { return Figure{static_cast<double>(n), 0}; };
  const auto compared = static_cast<double>(d.apart_m.size());
  const auto resets = std::count_if(run.events.begin(), run.events.end(), [](const auto& event) {
    return event.kind == BodyEvent::Kind::kReset;
  });
  const auto since = [&](Instant at) { return to_seconds(at - first); };
  const bool any = !d.apart_m.empty();
  return cells(
      job.name, count(run.trajectory.size()), count(run.live.size()), count(d.apart_m.size()),
      Figure{100 * d.wrong / compared, 2}, Figure{100 * d.shown / compared, 1},
      Figure{100 * d.shown_wrong / std::max(1.0, static_cast<double>(d.shown)), 2},
      Figure{100 * d.shown_gross / std::max(1.0, static_cast<double>(d.shown)), 2},
      Figure{100 * d.wrong_shape / compared, 2}, Figure{100 * d.beyond_sigma / compared, 2},
      Figure{100 * d.wrong_beyond_sigma / compared, 2}, Figure{100 * d.gross / compared, 2},
      Figure{kMm * quantile(d.apart_m, 0.5), 1}, Figure{kDegrees * quantile(d.apart_rad, 0.5), 2},
      Figure{kMm * quantile(d.apart_m, 0.95), 1}, Figure{kMm * largest(d.apart_m), 0},
      Figure{kDegrees * largest(d.apart_rad), 1}, Figure{any ? since(d.worst_at) : Nees::kNone, 1},
      Figure{d.wrong > 0 ? d.longest.seconds() : 0.0, 1},
      Figure{d.wrong > 0 ? since(d.longest.begin) : Nees::kNone, 1},
      count(static_cast<std::size_t>(resets)), count(run.tags.size()),
      Figure{run.statistics.update_cpu_s, 2});
}

}  // namespace

std::vector<Table> bench_live_branches(const EstimationOptions& options) {
  namespace fs = std::filesystem;
  Table table{"Real recordings without IMU: live poses against the settled ones at the same image",
              split("recording|images settled|live poses|compared|wrong %|valid %|wrong of valid %|"
                    "gross of valid %|wrong shape %|> 3 sigma %|wrong and > 3 sigma %|gross %|"
                    "median mm|median deg|95 % mm|worst mm|worst deg|worst at s|longest wrong s|"
                    "from s|resets|tags|update cpu s")};
  std::vector<Job> jobs;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(options.data, error)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_directory() || !name.starts_with("tagslam_")) continue;
    const bool is_wanted =
        options.classes.empty() ||
        std::find(options.classes.begin(), options.classes.end(), name) != options.classes.end();
    if (is_wanted) jobs.push_back({entry.path().string(), name});
  }
  if (jobs.empty()) table.remarks.emplace_back("NOT RUN: no tagslam_* in " + options.data);
  std::sort(jobs.begin(), jobs.end(), [](const Job& a, const Job& b) {
    return std::pair(a.name.size(), a.name) < std::pair(b.name.size(), b.name);
  });
  in_parallel(static_cast<int>(jobs.size()), options.threads, [&](int i) {
    Job& job = jobs[static_cast<std::size_t>(i)];
    job.result = run_one(job.folder, options);
  });
  for (const Job& job : jobs) {
    if (job.result) {
      table.rows.push_back(row_of(job));
    } else {
      table.remarks.emplace_back("NOT RUN: " + job.name + ": " + job.result.error().text());
    }
  }
  table.remarks.emplace_back(
      "wrong: more than 5 deg or 10 cm off; gross: more than 20 deg or 50 cm. Nothing is fitted; "
      "seconds from the first settled image on. Wrong shape: also after all live poses were moved "
      "together. > 3 sigma: of those stated, against the settled pose.");
  return {table};
}

}  // namespace fiducap::bench
