#pragma once

#include <map>
#include <optional>
#include <stop_token>
#include <vector>

#include "estimation/segment/motion_segment.hpp"
#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The place (epoch) of its tag that each sighting belongs to. A tag that was moved is another one
/// from then on: (id, epoch), epochs counted from 0.
class TagEpochs final {
 public:
  void follow(const EpochOrder& order);
  [[nodiscard]] int newest(int tag_id) const;
  /// nullopt: of no place.
  [[nodiscard]] std::optional<int> at(int tag_id, Instant seen_at) const;
  /// A segment has one place for each tag. Removes sightings of no place and, where a tag was moved
  /// meanwhile, of all but the newest, and those elsewhere than the segment has the tag.
  /// @return the epoch of each tag that is left
  std::vector<int> sort(MotionSegment& segment) const;

 private:
  std::map<int, std::vector<TagEpoch>> epochs_;  ///< By tag id, without the first one's.
};

/// The map of all bodies as a least squares problem over all their images and IMU samples: bodies
/// where their segments meet, cameras, tags. When there are many segments, they are folded into a
/// joint prior of tags and cameras (GraphPrior): time and memory are bounded by the number of tags.
/// Not thread-safe; slow.
class MapGraph final {
 public:
  MapGraph() = default;
  /// Starts with the estimates of an earlier session, and with surveyed tags. W is defined by the
  /// survey; or by the reference tag, of a new map or of one that refers to it; or by the mean of
  /// this map's tags. Of tags without correlations only the places are used: they are estimated
  /// again.
  explicit MapGraph(const TagMap& start);

  /// @return false: the segment has no information
  bool add(MotionSegment segment);
  /// Minimises the cost, and computes the covariance.
  /// @param stop  ends it after a step
  /// @return nullopt: there is nothing to solve, numbers are not finite, or it has not converged;
  /// the next call continues from there
  [[nodiscard]] std::optional<GraphSolution> solve(const std::stop_token& stop = {});
  /// A tag has left its place, or has not after all: its sightings are bound to another one.
  void follow(const EpochOrder& order);
  /// Replaces all segments of the workspace by a prior. solve() does so when there are many for its
  /// number of tags. @pre solve() has just converged
  void fold();
  /// Replaces all segments of a body by others.
  void replace_body(int body_id, std::vector<MotionSegment> segments);
  /// From now on solve() keeps any number of segments: offline.
  void keep_all() { keeps_all_ = true; }
  /// Makes the component with most tags the workspace, when there is none yet.
  /// @return whether it has
  bool establish_workspace();
  [[nodiscard]] const GraphState& state() const { return state_; }
  /// Against the definition of W. Refers to the graph.
  /// @return nullopt: there is no workspace, or the problem is singular
  [[nodiscard]] std::optional<GraphCovariance> covariance() const;

 private:
  struct Chain {
    std::optional<std::size_t> node;  ///< Where its last segment ended; nullopt: folded.
    int number{-1};
  };
  // Adding (map_graph.cpp). @param epochs  of the segment's tags
  std::size_t body_of(const MotionSegment& segment);
  [[nodiscard]] std::size_t begin_chain(std::size_t body, const MotionSegment& segment,
                                        bool is_in_workspace);
  [[nodiscard]] bool continues_chain(const MotionSegment& segment) const;
  [[nodiscard]] bool is_in_workspace(const MotionSegment& segment,
                                     const std::vector<int>& epochs) const;
  void hold_reference(const GraphSegment& entry, const std::vector<int>& epochs);
  void link_components(const GraphSegment& entry, int component);
  /// Adds tags that the component does not have.
  void bind_tags(const Pose& G, const std::vector<int>& epochs, GraphSegment& entry);
  void count_sightings(const GraphSegment& entry);
  void count_sightings();

  // Solving (graph_solve.cpp).
  [[nodiscard]] std::optional<GraphCovariance> settle(const std::stop_token& stop,
                                                      GraphSolution& done);
  bool iterate(const std::stop_token& stop, GraphSolution& done);
  int condense_again(const std::stop_token& stop);
  void align_to_reference();
  void fill_solution(const GraphCovariance& covariance, GraphSolution& out) const;

  // Removing (graph_fold.cpp).
  [[nodiscard]] int component_of(const GraphSegment& segment) const {
    return state_.nodes[segment.begin].component;
  }
  void renumber_chains(const std::vector<std::optional<std::size_t>>& now);
  void keep_bounded(bool is_converged);
  void drop_unbound(int component);

  GraphState state_;
  std::map<int, Chain> chains_;  ///< Per body id.
  /// Places of the tags that define W, by id and epoch.
  std::map<std::pair<int, int>, Eigen::Vector3d> definition_;
  TagEpochs epochs_;
  bool is_defined_{false};            ///< … from the beginning; false: all tags define it.
  std::optional<int> reference_tag_;  ///< Will define W once a body is anchored to it.
  int components_{0};
  bool keeps_all_{false};
};

}  // namespace fiducap
