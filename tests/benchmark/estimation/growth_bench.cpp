// Costs of a growing map: a ring with several robots, a tag every 0.92 m, and the time of each
// solution of the map graph while they walk.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>

#include "estimation/options.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap::bench {

namespace {

constexpr double kSeconds = 360;
constexpr double kLiveRefine_s = 10;  // of the robots' map, which costs as much again
constexpr double kSolve_s = 2;
constexpr double kRow_s = 30;
constexpr double kMetresPerTag = 0.92;
constexpr double kMiB = 1024.0 * 1024.0;

/// 36h11 has 587 ids; tagStandard41h12, with as few mistakes, 2115.
int tags_of(int robots) {
  if (robots <= 3) return 100;
  return robots <= 8 ? 300 : 1000;
}

double resident_mib() {
  std::ifstream statm("/proc/self/statm");
  long all = 0;
  long resident = 0;
  statm >> all >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / kMiB;
}

std::vector<EstimationData> robots_on_ring(const EstimationOptions& options, int robots) {
  return robots_of(robots, options.first_seed, [&](int k, std::uint64_t seed) {
    SimulatedDataSetup setup;
    setup.world = "ring";
    setup.seconds = options.seconds > 0 ? options.seconds : kSeconds;
    setup.seed = seed;
    const int tags = tags_of(robots);
    setup.ring = {kMetresPerTag * tags, tags};
    setup.from = static_cast<double>(k) / robots;
    setup.share = 1.35 / robots;
    return simulate(setup);
  });
}

/// Solutions between two rows.
struct Window {
  std::vector<double> seconds;
  int condensed{};
  int failed{};
};

class Growth final {
 public:
  Growth(int robots, Table& table, const std::vector<EstimationData>& data)
      : robots_(robots),
        table_(table),
        first_(time_of(data.front().samples.front())),
        before_mib_(resident_mib()) {
    TagMap nothing;
    nothing.reference_tag = data.front().reference_tag;
    graph_ = MapGraph(nothing);
  }

  void take(std::size_t body, const BodyUpdate& update) {
    if (update.segment) {
      MotionSegment segment = *update.segment;
      segment.body_id = static_cast<int>(body) + 1;
      numbers_ += graph_.add(std::move(segment)) ? 1 : 0;
    }
    const double t_s = to_seconds(update.seen.exposed_at - first_);
    if (t_s >= next_solve_s_) next_solve_s_ = t_s + std::max(kSolve_s, solve());
    if (t_s >= next_row_s_) {
      end_row(next_row_s_);
      next_row_s_ += kRow_s;
    }
  }

 private:
  /// @return seconds; a server begins the next one later
  double solve() {
    const auto begin = std::chrono::steady_clock::now();
    const auto solution = graph_.solve();
    window_.seconds.push_back(
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    if (solution) window_.condensed += solution->condensed;
    if (!solution && numbers_ > 0) ++window_.failed;
    return window_.seconds.back();
  }

  void end_row(double t_s) {
    std::sort(window_.seconds.begin(), window_.seconds.end());
    const double median = window_.seconds[window_.seconds.size() / 2];
    const auto& state = graph_.state();
    table_.rows.push_back(cells(robots_, fmt::format("{:.0f}", t_s), state.tags.size(), numbers_,
                                state.segments.size(), Figure{median, 3},
                                Figure{window_.seconds.back(), 3}, window_.condensed,
                                window_.failed, Figure{resident_mib() - before_mib_, 0}));
    window_ = {};
  }

  int robots_;
  Table& table_;
  Instant first_;
  double before_mib_;
  MapGraph graph_;
  int numbers_{};
  double next_solve_s_{kSolve_s};
  double next_row_s_{kRow_s};
  Window window_;
};

}  // namespace

std::vector<Table> bench_growth(const EstimationOptions& options) {
  Table table{fmt::format("Costs of a growing map, seed {}", options.first_seed),
              split("robots|after s|tags|segments so far|in the graph|solve s|largest|"
                    "linearised again|not at rest|MiB")};
  for (const std::string& name : options.classes) {
    const int robots = std::stoi(name);
    const std::vector<EstimationData> data = robots_on_ring(options, robots);
    FilterChoice choice = choice_of(options, "world", 'A');
    choice.live = true;
    choice.refine_period_s = kLiveRefine_s;
    Growth growth(robots, table, data);
    choice.listen = [&](std::size_t body, const BodyUpdate& update, const TagMap&) {
      growth.take(body, update);
    };
    (void)run_together(data, choice);
  }
  table.remarks.emplace_back(
      "A segment is about a second of one robot. `solve s`: median of the solutions of the last 30 "
      "s, one every 2 s of data or when the one before would be done, on one core. `in the graph`: "
      "the others are in a prior. `MiB`: of the process, beyond the sensors' data; it holds two "
      "such graphs, one of them for the robots' map, and all filters.");
  return {table};
}

}  // namespace fiducap::bench
