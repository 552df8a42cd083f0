#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::dds {

/// World axes of px4_msgs/VehicleOdometry for PX4's uXRCE-DDS bridge.
enum class Px4Profile { kOff, kNed, kFrd };

/// Topics on DDS. Domain, interface and peers: section `dds`.
struct DdsConfig {
  bool enabled{false};  ///< False: this protocol is not served.
  std::string prefix;   ///< Before the topics of a body: `/fiducap` gives `/fiducap/<body>/pose`.
  std::string world_frame{"world"};  ///< frame_id of the workspace; that of a body is its name.
  NameAliases aliases;               ///< Names for the clients, by name of the body.
  bool pose{true};                   ///< `/<body>/pose`, geometry_msgs/PoseStamped.
  bool twist{true};  ///< `/<body>/twist`, geometry_msgs/TwistStamped, in the world's axes.
  /// `/<body>/odom`, nav_msgs/Odometry with covariances, twist in the body's axes.
  bool odometry{true};
  bool tf{true};     ///< `/tf`: world → body. `/tf_static`: world → settled tags.
  bool poses{true};  ///< `/poses`, NamedPoseArray of motion_capture_tracking (Crazyswarm).
  /// Deadline QoS of `/poses`; subscribers that request a higher rate do not match. 0: none.
  double poses_deadline_hz{100};
  bool rigid_bodies{true};  ///< `/rigid_bodies`, mocap4r2_msgs/RigidBodies.
  bool diagnostics{true};   ///< `/diagnostics`, once a second.
  bool native{true};        ///< `fiducap/bodies`, `fiducap/tags` (proto/dds/fiducap.idl), keyed.
  /// `[/<body>]/fmu/in/vehicle_visual_odometry`; without the body's name when there is only one.
  Px4Profile px4{Px4Profile::kOff};
  double px4_rate_hz{50};  ///< Messages per second to PX4, at most.
  bool reliable{true};     ///< Also for reliable subscribers; false: best effort only.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

inline constexpr std::array<words::Word<Px4Profile>, 3> kPx4Profile{
    {{"off", Px4Profile::kOff}, {"ned", Px4Profile::kNed}, {"frd", Px4Profile::kFrd}}};

template <class V>
void describe(V& v, DdsConfig& c) {
  v.value("enabled", c.enabled);
  v.value("prefix", c.prefix);
  v.value("world_frame", c.world_frame);
  v.value("aliases", c.aliases);
  v.value("pose", c.pose);
  v.value("twist", c.twist);
  v.value("odometry", c.odometry);
  v.value("tf", c.tf);
  v.value("poses", c.poses);
  v.value("poses_deadline_hz", c.poses_deadline_hz);
  v.value("rigid_bodies", c.rigid_bodies);
  v.value("diagnostics", c.diagnostics);
  v.value("native", c.native);
  v.word("px4", c.px4, kPx4Profile);
  v.value("px4_rate_hz", c.px4_rate_hz);
  v.value("reliable", c.reliable);
}

using ProtocolConfig = DdsConfig;

/// ROS 2 topics and the native keyed types on DDS. A topic without subscribers is not written.
///
/// The middleware has its own threads for discovery and repeats; each topic is written once per
/// frame, on the I/O thread. Leaves a domain with too many participants or other cards
/// (Participant::is_to_be_left) and joins it again ten seconds later.
/// @return Error with the topic that could not be created
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const DdsConfig& config);

}  // namespace fiducap::dds
