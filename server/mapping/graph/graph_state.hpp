#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "estimation/segment/motion_segment.hpp"
#include "estimation/segment/segment_smoother.hpp"
#include "mapping/graph/graph_prior.hpp"

namespace fiducap {

inline constexpr int kInWorkspace = 0;  ///< Component of the workspace.
/// Sigma of what is exact by configuration (m, rad, s, px, relative): a thousandth of what any
/// published digit shows.
inline constexpr double kExactSigma = 1e-7;

/// Groups of parameters that are not as configured (kLens: all of it; kMountPosition: the pose),
/// and of which camera; -1: not of a camera.
using OpenParameters = std::set<std::pair<FoundMismatch::Kind, int>>;

/// The constants of a body.
struct GraphBody {
  int id{};
  std::shared_ptr<const SegmentSensors> sensors;
  std::vector<CameraBelief> cameras;
  std::vector<CameraBelief> expected;  ///< Prior mean of all cameras' parameters …
  Eigen::MatrixXd information;         ///< … and its information.
  OpenParameters open;                 ///< They have a wide prior.
  ImuIntrinsics imu;                   ///< By the filter.
  /// Index in GraphState::bodies of the same body before a jump of its clocks: all parameters but
  /// the clocks are shared. -1: none.
  int same_as{-1};
};

/// A body where two of its segments meet.
struct GraphNode {
  int body{};  ///< Index in GraphState::bodies.
  BodyMoment at;
  int component{};
};

struct GraphTag {
  int tag_id{};
  double edge_m{};
  Pose X_WT;
  int component{};
  int sightings{};
  int sightings_before{};  ///< Of those: in no segment, but in the prior.
  Instant first_seen{};
  Instant last_seen{};
  int epoch{};           ///< How often it was moved before (TagEpochs).
  double scale{};        ///< Relative error of its configured size, beyond the common one.
  bool scale_is_open{};  ///< It has one.
};

struct GraphSegment {
  MotionSegment raw;
  SegmentFactor factor;
  std::size_t begin{};  ///< Nodes …
  std::size_t end{};
  std::vector<std::size_t> tags;  ///< … and tags, in the order of the factor.
};

/// Prior of velocity and biases at the first node of a chain of segments. The biases continue from
/// the body's last chain.
struct ChainStart {
  std::size_t node{};
  int after{-1};  ///< Node at which the body's last chain ended; -1: none, or there is no IMU.
  bool has_imu{true};
  double accel_walk{};
  double gyro_walk{};
  std::optional<Eigen::Vector3d> up_B{};  ///< The vertical there, by odometry.
};

/// The variables of the map graph.
struct GraphEstimates {
  std::vector<GraphBody> bodies;
  std::vector<GraphNode> nodes;
  std::vector<GraphTag> tags;
  double common_scale{};         ///< Relative error of all configured tag sizes.
  double gravity_offset_m_s2{};  ///< Gravity minus the sensors' value.
};

/// All variables, factors and priors of the map graph.
struct GraphState : GraphEstimates {
  std::vector<GraphSegment> segments;
  std::vector<ChainStart> starts;
  bool common_scale_is_open{};                         ///< All sizes are wrong.
  double gravity_sigma_m_s2{kUsualGravitySigma_m_s2};  ///< Prior of gravity, 1-sigma.
  GraphPrior prior;
  std::map<int, bool> level;  ///< Per component: its vertical is known, by gravity or odometry.
};

// --- bodies ---

/// All parameters as configured.
[[nodiscard]] GraphBody body_by_configuration(int id,
                                              std::shared_ptr<const SegmentSensors> sensors);
/// The parameters found at the start are the first estimates, and the clocks the expected ones:
/// they may be far from the configuration.
void initialise_cameras(const std::vector<CameraBelief>& found, GraphBody& body);
/// Gives these parameters of a body a wide prior and all others that of the configuration.
void open_parameters(const OpenParameters& open, std::size_t body, GraphState& graph);
/// The same body after a jump of its cameras' clocks.
/// @param before  with this index
[[nodiscard]] GraphBody after_clock_jump(const GraphBody& before, int index,
                                         const MotionSegment& since);
/// The index of the same body before all jumps of its clocks.
[[nodiscard]] std::size_t first_of(std::size_t body, const GraphState& graph);
[[nodiscard]] bool clock_has_jumped(const GraphBody& body, const MotionSegment& segment);
/// Information of the equality of a camera's parameters before and after the jump, in the order of
/// segment_layout; of the clock 0.
using SameNumbers = Eigen::Matrix<double, segment_layout::kCameraSize, 1>;
[[nodiscard]] SameNumbers information_of_same();

/// The raw segment with ends, cameras and tags at their present estimates; the path between is
/// moved along.
[[nodiscard]] MotionSegment segment_now(const GraphState& graph, const GraphSegment& segment);

// --- components ---
// A component is a connected part in axes of its own; 0: in the workspace's. Two that are not
// joined may have the same tag, each at its own place.

/// X ← T X for all of it.
void move_component(int component, const Pose& T, GraphState& graph);
/// Makes all of `from` a part of `into`, whose axes T leads to; their common tags become one.
void merge_components(int from, int into, const Pose& T, GraphState& graph);
/// Unites tags with the same id and epoch, at the first one's index in `graph.tags`.
void unite_tags(int component, GraphState& graph);
/// @param now  the new index of each tag; `graph.tags` has the new order
void renumber_tags(const std::vector<std::size_t>& now, GraphState& graph);
/// Removes tags that are in no segment and not in the prior.
void forget_unseen_tags(GraphState& graph);
/// Gives parts that are not connected to the largest one components of their own.
/// @param next  number of a free component
/// @return the same, afterwards
[[nodiscard]] int split_component(int component, int next, GraphState& graph);
/// Removes segments, and nodes of no other segment. Where a chain is cut, its rest becomes a chain
/// of its own: velocity and biases there are unknown. Tags stay.
/// @return the new number of each node that is left
std::vector<std::optional<std::size_t>> keep_segments(
    const std::function<bool(const GraphSegment&)>& is_kept, GraphState& graph);
/// Removes the segments of components without a tag. @return as keep_segments()
std::vector<std::optional<std::size_t>> forget_unbound_paths(GraphState& graph);

}  // namespace fiducap
