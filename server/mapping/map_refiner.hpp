#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "mapping/graph/map_graph.hpp"
#include "mapping/map_builder.hpp"

namespace fiducap {

/// When a refinement looked at what the bodies had said, and when the map took it over, in
/// contributions to the map before that: a replay does the same.
struct RefinementTurn {
  std::uint64_t taken{};
  /// nullopt: it came to nothing. Still the graph went on from where that left it.
  std::optional<std::uint64_t> adopted{};
};

/// Brings the map up to date with everything that all bodies have seen: takes their segments out of
/// the builder, solves the graph, hands the solution back. For one thread; the builder is locked
/// for moments only.
class MapRefiner final {
 public:
  explicit MapRefiner(MapBuilder& map) : MapRefiner(map, {}) {}
  /// @param surveyed  tags that are to be estimated all the same, by a rough survey as well
  MapRefiner(MapBuilder& map, std::span<const KnownTag> surveyed);

  /// Takes what has come since the last time into the graph; begins a new one when the map was
  /// replaced. The map keeps a limited number.
  void take();
  /// The same, and solves. Nothing of it is published yet.
  /// @param stop  leaves the solution for another time
  /// @return whether there is something to publish
  bool solve(const std::stop_token& stop = {});
  /// Solves for what take() has taken. The map is not touched: a thread that does not get on holds
  /// up nobody.
  bool solve_taken(const std::stop_token& stop = {});
  /// See MapGraph.
  bool found_workspace();
  void replace_body(int body_id, std::vector<MotionSegment> segments);
  /// Publishes what solve() has found, when it has.
  /// @return nullopt: there was nothing to solve since the last time
  std::optional<RefinementTurn> adopt(std::int64_t utc_now_ns);

  /// From now on the map gets tags that were seen so often, whatever it is configured to.
  void tell_from(int sightings) { least_sightings_ = sightings; }
  /// Nothing is folded, however long it takes: offline.
  void keep_all() {
    keeps_all_ = true;
    graph_.keep_all();
  }
  [[nodiscard]] const MapGraph& graph() const { return graph_; }
  /// What the last solution has found to be other than configured.
  [[nodiscard]] const std::vector<GraphFinding>& findings() const { return findings_; }

 private:
  void begin_with(const TagMap& map);

  MapBuilder& map_;
  MapGraph graph_;
  bool keeps_all_{false};
  std::optional<GraphSolution> solution_;
  std::vector<GraphFinding> findings_;
  std::optional<std::uint64_t> taken_{};  ///< By a solve() since the last adopt().
  std::uint64_t contributions_{};         ///< Before the last take().
  std::optional<int> least_sightings_{};
  bool is_settled_{true};  ///< The last solution stands: without news there is nothing to do.
};

}  // namespace fiducap
