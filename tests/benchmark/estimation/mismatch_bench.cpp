// A world that differs from the configuration, one mismatch at a time: errors against the same
// seeds without it, whether the sigma covers them, and the reports.
#include "simulation/mismatch_worlds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <map>

#include "estimation/filter/chi_square.hpp"
#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

using At = FilterRun::At;

constexpr double kElsewhere_m = 1.0;  // valid poses with larger errors are of another place
constexpr double kWrong_m = 0.1;      // above this and kCertain sigmas a pose is falsely certain
constexpr double kCertain = 5.0;
constexpr double kOff = 4.0;            // sigmas of a normal variable: a pose beyond is off
constexpr double kTableSeconds = 30.0;  // its camera sees all tags within two
constexpr std::size_t kLetters = 100;   // of a report
constexpr std::size_t kReports = 3;     // of a row

struct Score {
  std::uint64_t seed{};
  double median_m{Nees::kNone}, rms_m{Nees::kNone};  // after kSettled_s
  double nees{Nees::kNone}, inside{Nees::kNone};     // the same
  double largest_m{};                                // of the whole run
  double with_pose{};
  double off_s{};  // valid, and beyond kOff
  int resets{}, dropped{};
  bool elsewhere{}, silent{}, names_right{}, names_wrong{};
  std::vector<std::string> said;
};

Score score_of(FilterRun run, std::uint64_t seed) {
  static const double kInside = chi_square_quantile(6, 0.95);
  static const double kOffSquare = chi_square_quantile(6, std::erf(kOff / std::sqrt(2.0)));
  Score score;
  score.seed = seed;
  score.resets = run.resets;
  score.dropped = run.tags_dropped;
  score.said = run.said;
  std::erase_if(run.at, [](const At& at) { return !at.valid; });
  score.with_pose = static_cast<double>(run.at.size()) / std::max(1, run.frames);
  for (const At& at : run.at) {
    const double error_m = at.level_position_m;
    score.largest_m = std::max(score.largest_m, error_m);
    score.elsewhere |= error_m > kElsewhere_m;
    score.off_s += at.nees.pose > kOffSquare ? run.seconds / run.frames : 0;
    score.silent |= error_m > kWrong_m && error_m > kCertain * at.sigma_m && run.said.empty();
  }
  const FilterRun settled = run.scored_after(kSettled_s);
  std::vector<double> errors;
  for (const At& at : settled.at) errors.push_back(at.level_position_m);
  score.median_m = median(errors);
  score.rms_m = settled.rms([](const At& at) { return at.level_position_m; });
  score.nees = settled.mean([](const At& at) { return at.nees.pose / 6; });
  score.inside = settled.mean([](const At& at) { return at.nees.pose < kInside ? 1.0 : 0.0; });
  return score;
}

std::vector<double> each(const std::vector<Score>& scores, double Score::*figure) {
  std::vector<double> values;
  for (const Score& score : scores) values.push_back(score.*figure);
  return values;
}

template <class T>
int sum(const std::vector<Score>& scores, T Score::*figure) {
  int all = 0;
  for (const Score& score : scores) all += score.*figure;
  return all;
}

double median_ratio(const std::vector<Score>& scores, const std::vector<Score>& unmodified) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < scores.size(); ++i)
    ratios.push_back(scores[i].median_m / unmodified[i].median_m);
  return median(ratios);
}

/// Only numbers differ from run to run.
std::string without_numbers(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool digit = std::isdigit(static_cast<unsigned char>(c)) != 0;
    if (!digit || out.empty() || out.back() != '#') out += digit ? '#' : c;
  }
  return out;
}

std::string shortened(const std::string& text) {
  std::size_t letters = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins = (static_cast<unsigned char>(text[i]) & 0xC0) != 0x80;
    if (begins && ++letters > kLetters) return text.substr(0, i) + "…";
  }
  return text;
}

struct Report {
  std::string text;  ///< Of the first run.
  int runs{};
};

/// The most frequent reports.
std::vector<Report> frequent_reports(const std::vector<Score>& scores) {
  std::map<std::string, Report> by_words;
  for (const Score& score : scores) {
    std::map<std::string, std::string> of_run;
    for (const std::string& text : score.said) of_run.try_emplace(without_numbers(text), text);
    for (const auto& [words, text] : of_run) {
      Report& one = by_words.try_emplace(words, Report{text, 0}).first->second;
      ++one.runs;
    }
  }
  std::vector<Report> all;
  for (const auto& [words, report] : by_words) all.push_back(report);
  std::stable_sort(all.begin(), all.end(),
                   [](const Report& a, const Report& b) { return a.runs > b.runs; });
  all.resize(std::min(all.size(), kReports));
  return all;
}

void print_each(const std::string& what, const std::vector<Score>& scores) {
  for (const Score& s : scores) {
    fmt::print(
        "{} seed {}: median {:.2f} mm, NEES {:.2f}, inside {:.1f} %, largest {:.3f} m, "
        "pose {:.1f} %, off {:.1f} s, {} resets",
        what, s.seed, kMm * s.median_m, s.nees, 100 * s.inside, s.largest_m, 100 * s.with_pose,
        s.off_s, s.resets);
    for (const std::string& text : s.said) fmt::print(" [{}]", shortened(text));
    fmt::print("\n");
  }
  std::fflush(stdout);
}

/// All rows of one class with one filter.
class Rows {
 public:
  Rows(const EstimationOptions& options, std::string world, std::string filter)
      : options_(options), world_(std::move(world)), filter_(std::move(filter)) {}

  void add(const Mismatch& mismatch, Table& figures, Table& reports) {
    const std::vector<Score>& unmodified = unmodified_of(mismatch);
    const std::vector<Score> scores =
        mismatch.is_unmodified() ? unmodified : run(mismatched_world, mismatch, mismatch.map);
    if (options_.each) print_each(world_ + " " + filter_ + " " + mismatch.name, scores);
    figures.rows.push_back(row(mismatch.name, scores, unmodified));
    for (const Report& report : frequent_reports(scores))
      reports.rows.push_back(
          {world_, filter_, mismatch.name, std::to_string(report.runs), shortened(report.text)});
    if (mismatch.name == "outages") figures.remarks.push_back(summary(scores));
  }

 private:
  using World = std::function<EstimationData(const SimulatedDataSetup&, const Mismatch&)>;

  std::vector<Score> run(World data_of, const Mismatch& mismatch, const Mismatch::Map& map) const {
    FilterChoice choice = choice_of(options_, filter_, options_.cases.front());
    choice.live = true;
    return for_seeds(options_, [&](std::uint64_t seed) {
      const EstimationData data = data_of(
          {.world = world_, .seconds = seconds(), .seed = seed, .has_imu = !options_.without_imu},
          mismatch);
      FilterChoice own = choice;
      if (map) own.start = map(data, seed);
      const FilterRun done = run_filter(data, own);
      Score score = score_of(done, seed);
      for (const NamedCause& cause : done.named)
        if (is_right(cause, mismatch, data))
          score.names_right = true;
        else if (!cause.is_ambiguous)
          score.names_wrong = true;
      return score;
    });
  }

  const std::vector<Score>& unmodified_of(const Mismatch& mismatch) {
    const auto found = unmodified_.find(mismatch.base);
    if (found != unmodified_.end()) return found->second;
    return unmodified_[mismatch.base] = run(unmodified_world, mismatch, mismatch.base_map);
  }

  [[nodiscard]] double seconds() const {
    if (options_.seconds > 0) return options_.seconds;
    return world_ == "table" ? kTableSeconds : seconds_of(options_, world_);
  }

  [[nodiscard]] std::vector<Cell> row(const std::string& name, const std::vector<Score>& scores,
                                      const std::vector<Score>& unmodified) const {
    const auto worst =
        std::max_element(scores.begin(), scores.end(),
                         [](const Score& a, const Score& b) { return a.largest_m < b.largest_m; });
    int reporting = 0;
    for (const Score& score : scores) reporting += score.said.empty() ? 0 : 1;
    const auto percent = [&](bool Score::*is) {
      return Figure{100.0 * sum(scores, is) / static_cast<double>(scores.size()), 0};
    };
    return cells(
        world_, filter_, name, Figure{kMm * median(each(scores, &Score::median_m)), 2},
        Figure{median_ratio(scores, unmodified), 2},
        Figure{kMm * largest(each(scores, &Score::median_m)), 1}, Figure{worst->largest_m, 3},
        worst->seed, Figure{median(each(scores, &Score::nees)), 2},
        Figure{100 * median(each(scores, &Score::inside)), 1},
        Figure{100 * median(each(scores, &Score::with_pose)), 1}, sum(scores, &Score::resets),
        sum(scores, &Score::dropped), sum(scores, &Score::elsewhere), sum(scores, &Score::silent),
        reporting, percent(&Score::names_right), percent(&Score::names_wrong),
        Figure{largest(each(scores, &Score::off_s)), 1});
  }

  [[nodiscard]] std::string summary(const std::vector<Score>& scores) const {
    constexpr double kLost_m = 0.1;
    const auto above = std::count_if(scores.begin(), scores.end(),
                                     [](const Score& s) { return !(s.rms_m <= kLost_m); });
    return fmt::format(
        "outages, {}, {}: run medians {:.1f} mm, worst {:.1f} mm; run RMS {:.1f} mm, worst {:.1f} "
        "mm; {} of {} runs above {:.0f} mm RMS",
        world_, filter_, kMm * median(each(scores, &Score::median_m)),
        kMm * largest(each(scores, &Score::median_m)), kMm * median(each(scores, &Score::rms_m)),
        kMm * largest(each(scores, &Score::rms_m)), above, scores.size(), kMm * kLost_m);
  }

  const EstimationOptions& options_;
  std::string world_;
  std::string filter_;
  std::map<std::string, std::vector<Score>> unmodified_;  ///< By Mismatch::base.
};

bool is_requested(const EstimationOptions& options, const std::string& name) {
  if (options.quick) return name == "nothing" || name == "stamps 3 ms";
  return name == "nothing" || options.includes(name);
}

}  // namespace

std::vector<Table> bench_mismatch(const EstimationOptions& options) {
  Table figures{
      fmt::format("Mismatches, {} seeds from {}: the live path, valid poses in level axes",
                  options.seeds, options.first_seed),
      split("class|filter|wrong|median mm|x|worst mm|largest m|of seed|pose NEES|inside %|"
            "with pose %|resets|dropped|> 1 m|silent|reporting|right %|wrong %|off s")};
  Table reports{"Reports, and in how many runs", {"class", "filter", "wrong", "runs", "report"}};
  for (const std::string& world : options.classes) {
    for (const std::string& filter : options.filters) {
      Rows rows(options, world, filter);
      for (const Mismatch& mismatch : mismatches()) {
        if (is_requested(options, mismatch.name)) rows.add(mismatch, figures, reports);
      }
    }
  }
  figures.remarks.emplace_back(
      "median, NEES, inside: medians over runs, after 5 s. x: median over seeds of median error / "
      "that without the mismatch. largest, > 1 m: from the first pose on.");
  figures.remarks.emplace_back(
      "inside: the pose's 95 % ellipsoid. > 1 m, silent, reporting: runs. silent: more than 0.1 m "
      "and 5 sigma off, without any report in the whole run.");
  figures.remarks.emplace_back(
      "right, wrong: runs with a report that names what is wrong, or something else (kinds of "
      "mismatch, sizes, clock, IMU, axes), but as one of several possible causes. off: seconds of "
      "the worst run with a valid pose whose "
      "6-DoF error is beyond 4 sigma (of a normal variable of equal probability).");
  return {figures, reports};
}

}  // namespace fiducap::bench
