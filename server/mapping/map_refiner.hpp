#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "mapping/graph/map_graph.hpp"
#include "mapping/map_builder.hpp"

namespace fiducap {

/// When a refinement took the contributions, and when the map adopted the result, in numbers of
/// contributions before that: a replay repeats them.
struct RefinementTurn {
  std::uint64_t taken{};
  /// nullopt: no result. The graph continues from its last state.
  std::optional<std::uint64_t> adopted{};
};

/// Keeps the map up to date with the segments of all bodies: takes them out of the builder, solves
/// the graph, hands the solution back. For one thread; the builder is locked only briefly.
class MapRefiner final {
 public:
  explicit MapRefiner(MapBuilder& map) : MapRefiner(map, {}) {}
  /// @param surveyed  tags that are estimated nevertheless, with a rough survey
  MapRefiner(MapBuilder& map, std::span<const KnownTag> surveyed);

  /// Moves new segments into the graph; restarts it when the map was replaced. The builder keeps a
  /// limited number.
  void take();
  /// Takes and solves. Nothing is published yet.
  /// @param stop  postpones the solution
  /// @return whether there is something to publish
  bool solve(const std::stop_token& stop = {});
  /// Solves with the segments that take() has taken. The builder is not locked: a slow solution
  /// delays no other thread.
  bool solve_taken(const std::stop_token& stop = {});
  /// See MapGraph.
  bool establish_workspace();
  void replace_body(int body_id, std::vector<MotionSegment> segments);
  /// Publishes the solution, if there is one.
  /// @return nullopt: there was nothing to solve since the last time
  std::optional<RefinementTurn> adopt(std::int64_t utc_now_ns);

  /// From now on the map gets tags with this number of sightings, in place of the configured one.
  void set_least_sightings(int sightings) { least_sightings_ = sightings; }
  /// Nothing is folded: offline.
  void keep_all() {
    keeps_all_ = true;
    graph_.keep_all();
  }
  [[nodiscard]] const MapGraph& graph() const { return graph_; }
  /// Deviations from the configuration, of the last solution.
  [[nodiscard]] const std::vector<GraphFinding>& findings() const { return findings_; }

 private:
  MapBuilder& map_;
  MapGraph graph_;
  bool keeps_all_{false};
  std::optional<GraphSolution> solution_;
  std::vector<GraphFinding> findings_;
  std::optional<std::uint64_t> taken_{};  ///< By a solve() since the last adopt().
  std::uint64_t contributions_{};         ///< Before the last take().
  std::optional<int> least_sightings_{};
  bool is_settled_{true};  ///< Nothing has changed since the last solution.
};

}  // namespace fiducap
