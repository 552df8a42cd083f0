#pragma once

#include <map>
#include <optional>
#include <set>
#include <span>
#include <stop_token>
#include <vector>

#include "mapping/graph/graph_solution.hpp"
#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// The one map of all bodies as a least squares problem over everything that they ever saw and
/// felt: bodies where their segments meet, cameras, tags. Not thread-safe; slow; memory grows with
/// the segments.
class MapGraph final {
 public:
  /// @return whether it says anything
  bool add(MotionSegment segment);
  /// Moves everything to where it fits best, and tells how well that is known.
  /// @param stop  ends it after a step
  /// @return nullopt when there is nothing to solve, numbers are not finite, or it still moves:
  /// then the next call goes on from there
  [[nodiscard]] std::optional<GraphSolution> solve(const std::stop_token& stop = {});
  /// The component with most tags becomes the workspace, when nobody stands in it yet.
  /// @return whether one has
  bool found_workspace();
  /// From now on W is where these tags are in the mean: what is solved later is laid over them.
  void define_axes();
  /// Moves the workspace as one so that these tags are where they are given, as well as they can.
  /// @return false: it has none of them
  bool stand_on(std::span<const KnownTag> given);
  [[nodiscard]] const GraphState& state() const { return state_; }

 private:
  struct Chain {
    std::size_t node{};  ///< Where its last segment ended.
    int number{-1};
  };
  std::size_t body_of(const MotionSegment& segment);
  [[nodiscard]] std::size_t begin_chain(std::size_t body, const MotionSegment& segment);
  [[nodiscard]] bool is_in_workspace(const MotionSegment& segment) const;
  void join_workspace(std::size_t begin, const MotionSegment& segment);
  void count_sightings(const GraphSegment& entry);
  void link_components(const GraphSegment& entry, int component);
  /// Index of a tag, added when the component does not have it.
  [[nodiscard]] std::size_t tag_of(int component, const KnownTag& tag, const Pose& X_WT,
                                   Instant now);
  bool iterate(const std::stop_token& stop, GraphSolution& done);
  int condense_again();
  void lay_over_definition();
  void lay_over_places();
  [[nodiscard]] std::optional<GraphSolution> tell();

  GraphState state_;
  std::map<int, Chain> chains_;                ///< Per body id.
  std::map<int, Eigen::Vector3d> definition_;  ///< Places of the tags that define W.
  bool is_defined_{false};
  int components_{0};
};

}  // namespace fiducap
