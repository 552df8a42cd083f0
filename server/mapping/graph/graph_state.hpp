#pragma once

#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "estimation/segment/motion_segment.hpp"
#include "estimation/segment/segment_smoother.hpp"
#include "estimation/segment/world_error.hpp"
#include "mapping/graph/graph_body.hpp"
#include "mapping/graph/graph_prior.hpp"

namespace fiducap {

inline constexpr int kInWorkspace = 0;  ///< Component of those who stand in it.

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
  int epoch{};     ///< How often it was moved before (TagEpochs).
  double scale{};  ///< So much larger is its print than told, beyond what all are, relative …
  Doubt print{};   ///< … and whether that is so.
};

struct GraphSegment {
  MotionSegment raw;
  SegmentFactor factor;
  std::size_t begin{};  ///< Nodes …
  std::size_t end{};
  std::vector<std::size_t> tags;  ///< … and tags, in the order of the factor.
};

/// A node whose velocity and biases are known a little without any segment: the first of a chain.
/// Biases go on from where the body's last chain left them.
struct ChainStart {
  std::size_t node{};
  int after{-1};  ///< Node at which the body's last chain ended; -1: none, or there is no IMU.
  bool has_imu{true};
  double accel_walk{};
  double gyro_walk{};
  std::optional<Eigen::Vector3d> up_B{};  ///< What is up there, as odometry knows it.
};

/// All that is estimated, and all that says something about it.
struct GraphState {
  std::vector<GraphBody> bodies;
  std::vector<GraphNode> nodes;
  std::vector<GraphTag> tags;
  std::vector<GraphSegment> segments;
  std::vector<ChainStart> starts;
  double prints_scale{};         ///< So much larger are all prints than told, relative …
  Doubt prints;                  ///< … and whether that is so.
  bool doubts{false};            ///< Prints may be other ones than told.
  double gravity_offset_m_s2{};  ///< How much more gravity is than the sensors say …
  double gravity_sigma_m_s2{kUsualGravitySigma_m_s2};  ///< … and may be, 1-sigma.
  GraphPrior prior;
  std::map<int, bool> level;  ///< Per component: gravity is felt in it, or odometry knows up.
};

}  // namespace fiducap
