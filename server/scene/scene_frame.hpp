#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/body_pose.hpp"

namespace fiducap {

/// What does not change from frame to frame about a body.
struct BodyDescription {
  int id{};          ///< Streaming id, 1..; stable.
  std::string name;  ///< As in the configuration.
};

/// The bodies a client can ask for. A new generation is published when the list changes.
struct SceneModel {
  std::uint64_t generation{1};
  std::vector<BodyDescription> bodies;
};

/// All bodies at one instant, and the map. Immutable once published, shared by all protocols. What
/// is called W here is the room R where an operator has aligned the map to it (RoomAxes).
struct SceneFrame {
  std::uint64_t number{};  ///< Counts up by 1 from the start of the server.
  Instant at{};            ///< The instant the poses are *for*.
  Instant published_at{};  ///< When this frame was made.
  Duration utc_offset{};   ///< UTC = server time + utc_offset.
  double rate_hz{};
  /// Counts the alignments: poses of frames with another number stand in other axes.
  std::uint64_t axes{};
  std::vector<BodyPose> bodies;  ///< Order of model->bodies.
  std::shared_ptr<const SceneModel> model;
  std::shared_ptr<const TagMap> map;

  [[nodiscard]] std::int64_t utc_ns() const { return to_ns(at) + utc_offset.count(); }
};

}  // namespace fiducap
