// Rooms with and without texture and with gaps without tags: benefit and cost of followed image
// points.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "estimation/ensemble.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

using At = FilterRun::At;

constexpr double kBetween_s = 7.0;  // with tags, after each gap
constexpr double kFirst_s = 12.0;   // the first gap begins

struct Gaps {
  double length_s{};  ///< 0: none
  double seconds{};   ///< of data
  [[nodiscard]] bool inside(double t_s) const {
    if (length_s == 0 || t_s < kFirst_s) return false;
    return std::fmod(t_s - kFirst_s, length_s + kBetween_s) < length_s;
  }
};

/// Without the tags of the images inside gaps. The points stay: they were followed with the tags in
/// view.
EstimationData blinded(EstimationData data, const Gaps& gaps) {
  const Instant first = time_of(data.samples.front());
  for_each_image(data, [&](CornerFrame& image) {
    if (gaps.inside(to_seconds(image.exposed_at - first))) image.tags.clear();
  });
  return data;
}

/// One filter over all seeds of one class and gap length.
struct Arm {
  MeanSquare end_m, end_rad, end_m_s, sigma;  ///< At the last image of each gap.
  MeanSquare all_m, all_rad;                  ///< At every image after the start.
  std::vector<double> run_m;                  ///< RMSE of each seed.
  double nees{};                              ///< MeanSquare over gap ends, of 6.
  double nees_all{};
  int images{};
  int covered{};
  long used{}, rejected{};
  double nis{};
  long long nis_dof{};
  double cpu_s{};
  double seconds{};
};

void add(Arm& arm, const FilterRun& run, const Gaps& gaps) {
  static const double kCovered = chi_square_quantile(6, 0.95);
  MeanSquare own;
  for (std::size_t i = 0; i < run.at.size(); ++i) {
    const At& at = run.at[i];
    if (at.t_s < kSettled_s) continue;
    own.add(at.level_position_m);
    arm.all_m.add(at.level_position_m);
    arm.all_rad.add(at.level_rotation_rad);
    arm.nees_all += at.nees.pose;
    ++arm.images;
    const bool last =
        gaps.inside(at.t_s) && i + 1 < run.at.size() && !gaps.inside(run.at[i + 1].t_s);
    if (!last) continue;
    arm.end_m.add(at.level_position_m);
    arm.end_rad.add(at.level_rotation_rad);
    arm.end_m_s.add(at.velocity_m_s);
    arm.sigma.add(at.sigma_m);
    arm.nees += at.nees.pose;
    arm.covered += at.nees.pose < kCovered ? 1 : 0;
  }
  arm.run_m.push_back(own.rms());
  arm.used += run.landmarks_used;
  arm.rejected += run.landmarks_rejected;
  arm.nis += run.landmark_nis;
  arm.nis_dof += run.landmark_nis_dof;
  arm.cpu_s += run.update_cpu_s + run.propagate_cpu_s;
  arm.seconds += run.seconds;
}

struct Pair {
  Arm without, with;
};

void print(Table& table, const std::string& world, const std::string& texture, const Gaps& gaps,
           const Pair& cell) {
  double worst = 0;
  for (std::size_t i = 0; i < cell.with.run_m.size(); ++i)
    worst = std::max(worst, cell.with.run_m[i] / cell.without.run_m[i]);
  for (const Arm* arm : {&cell.without, &cell.with}) {
    const bool with = arm == &cell.with;
    const double ends = arm->end_m.count == 0 ? Nees::kNone : arm->end_m.count;
    table.rows.push_back(cells(
        world, texture, Figure{gaps.length_s, 0}, with ? "with" : "without", arm->end_m.count,
        Figure{kMm * arm->end_m.rms(), 1}, Figure{kMm * arm->sigma.rms(), 1},
        Figure{100 * arm->covered / ends, 0}, Figure{arm->nees / ends / 6, 2},
        Figure{kDegrees * arm->end_rad.rms(), 3}, Figure{kMm * arm->end_m_s.rms(), 1},
        Figure{kMm * arm->all_m.rms(), 2}, Figure{kDegrees * arm->all_rad.rms(), 3},
        Figure{arm->nees_all / arm->images / 6, 2},
        with ? Figure{cell.with.all_m.rms() / cell.without.all_m.rms(), 3} : Figure{1, 3},
        with ? Figure{worst, 3} : Figure{1, 3},
        Figure{static_cast<double>(arm->used) / arm->seconds, 1},
        Figure{static_cast<double>(arm->rejected) / arm->seconds, 1},
        Figure{arm->nis_dof == 0 ? Nees::kNone : arm->nis / static_cast<double>(arm->nis_dof), 2},
        Figure{arm->cpu_s / arm->seconds, 4}));
  }
}

}  // namespace

std::vector<Table> bench_landmarks(const EstimationOptions& options) {
  Table table{
      fmt::format("Followed image points, {} seeds of rendered images; at the last image of "
                  "each gap without tags and over all (mm, deg, mm/s)",
                  options.seeds),
      split("class|texture|gap s|points|gaps|pos|sigma|covered %|NEES/6|ori|vel|all pos|all ori|"
            "all NEES/6|all ratio|worst run|used/s|gated/s|NIS/dof|CPU s/s")};
  const std::vector<double> lengths =
      options.quick ? std::vector{2.0} : std::vector{0.0, 1.0, 2.0, 5.0, 10.0};
  for (const std::string& world : options.classes) {
    for (const std::string& texture : options.textures) {
      const double seconds = options.seconds > 0 ? options.seconds : options.quick ? 20 : 60;
      const auto runs = for_seeds(options, [&](std::uint64_t seed) {
        std::vector<std::pair<FilterRun, FilterRun>> pairs;
        const EstimationData data =
            simulate({.world = world, .seconds = seconds, .seed = seed, .texture = texture});
        for (const double length_s : lengths) {
          const EstimationData seen = blinded(data, {length_s, seconds});
          FilterChoice choice = choice_of(options, "world", options.cases.front());
          const FilterRun without = run_filter(seen, choice);
          choice.estimator.landmarks = true;
          pairs.emplace_back(without, run_filter(seen, choice));
        }
        return pairs;
      });
      for (std::size_t k = 0; k < lengths.size(); ++k) {
        Pair cell;
        const Gaps gaps{lengths[k], seconds};
        for (const auto& seed : runs) {
          add(cell.without, seed[k].first, gaps);
          add(cell.with, seed[k].second, gaps);
        }
        print(table, world, texture, gaps, cell);
      }
    }
  }
  table.remarks.emplace_back(
      "Level axes at the reference tag. covered: pose inside its own 95 % ellipsoid. all: every "
      "image after 5 s, gaps or not.");
  table.remarks.emplace_back(
      "all ratio: RMSE with over without, all seeds; worst run: the largest of one seed. CPU: "
      "filter alone, whole run.");
  return {table};
}

}  // namespace fiducap::bench
