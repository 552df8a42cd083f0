#pragma once

#include <map>
#include <optional>
#include <set>
#include <stop_token>
#include <vector>

#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/tag_epochs.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The one map of all bodies as a least squares problem over everything that they ever saw and
/// felt: bodies where their segments meet, cameras, tags. When there are many segments, what they
/// say of tags and cameras is kept (GraphPrior), and they go: time and memory are bounded by the
/// number of tags. Not thread-safe; slow.
class MapGraph final {
 public:
  MapGraph() = default;
  /// Begins with what an earlier session has learned, and with surveyed tags. W is where a survey
  /// says; or where the reference tag says, of a new map or of one that hangs on it; or where this
  /// map's tags are in the mean. Of tags whose errors' ties it does not know it takes the places
  /// alone: they are learned anew.
  explicit MapGraph(const TagMap& start);

  /// @return whether it says anything
  bool add(MotionSegment segment);
  /// Moves everything to where it fits best, and tells how well that is known.
  /// @param stop  ends it after a step
  /// @return nullopt when there is nothing to solve, numbers are not finite, or it still moves:
  /// then the next call goes on from there
  [[nodiscard]] std::optional<GraphSolution> solve(const std::stop_token& stop = {});
  /// A tag has left its place, or has not after all: sightings bind to another one.
  void follow(const EpochOrder& order);
  /// What all segments of the workspace say becomes a prior, and they go. solve() does so when
  /// there are many for its number of tags. @pre solve() has just come to rest
  void fold();
  /// All that a body has said until now was not what it meant: this is.
  void replace_body(int body_id, std::vector<MotionSegment> segments);
  /// From now on solve() gives up no segment, however many there are: offline.
  void keep_all() { keeps_all_ = true; }
  /// The component with most tags becomes the workspace, when nobody stands in it yet.
  /// @return whether one has
  bool found_workspace();
  [[nodiscard]] const GraphState& state() const { return state_; }
  /// How well it is known, against what defines W. Refers to the graph.
  /// @return nullopt: nothing stands in W, or something is not bound to anything
  [[nodiscard]] std::optional<GraphCovariance> covariance() const;

 private:
  struct Chain {
    std::optional<std::size_t> node;  ///< Where its last segment ended; nullopt: folded.
    int number{-1};
  };
  std::size_t body_of(const MotionSegment& segment);
  [[nodiscard]] std::size_t begin_chain(std::size_t body, const MotionSegment& segment,
                                        bool is_in_workspace);
  [[nodiscard]] bool goes_on(const MotionSegment& segment) const;
  /// @param epochs  of the segment's tags
  [[nodiscard]] bool is_in_workspace(const MotionSegment& segment,
                                     const std::vector<int>& epochs) const;
  void join_workspace(std::size_t begin, const MotionSegment& segment,
                      const std::vector<int>& epochs);
  void bind_anew(GraphSegment& entry);
  void count_sightings(const GraphSegment& entry);
  /// @param epochs  of the segment's tags
  void hold_reference(const MotionSegment& segment, const std::vector<int>& epochs, int component);
  void count_sightings();
  void renumber_chains(const std::vector<std::optional<std::size_t>>& now);
  void link_components(const GraphSegment& entry, int component);
  /// Index of a tag, added when the component does not have it.
  [[nodiscard]] std::size_t tag_of(int component, const KnownTag& tag, int epoch, const Pose& X_WT,
                                   Instant now);
  [[nodiscard]] std::optional<GraphCovariance> settle(const std::stop_token& stop,
                                                      GraphSolution& done);
  bool iterate(const std::stop_token& stop, GraphSolution& done);
  int condense_again(const std::stop_token& stop);
  [[nodiscard]] int component_of(const GraphSegment& segment) const {
    return state_.nodes[segment.begin].component;
  }
  void keep_bounded(bool is_at_rest);
  void forget_oldest(int component, std::size_t count);
  void drop_unbound(int component);
  void lay_over_definition();
  void lay_over_places();
  void tell(const GraphCovariance& covariance, GraphSolution& out) const;

  GraphState state_;
  std::map<int, Chain> chains_;  ///< Per body id.
  /// Places of the tags that define W, by id and epoch.
  std::map<std::pair<int, int>, Eigen::Vector3d> definition_;
  TagEpochs epochs_;
  bool is_defined_{false};            ///< … from the beginning; false: all tags do.
  std::optional<int> reference_tag_;  ///< Will define W as soon as a body stands by it.
  int components_{0};
  bool keeps_all_{false};
};

}  // namespace fiducap
