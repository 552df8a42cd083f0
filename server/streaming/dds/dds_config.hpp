#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/client_names.hpp"

namespace fiducap::dds {

/// px4_msgs/VehicleOdometry for PX4's uXRCE-DDS bridge: which world axes it is told about.
enum class Px4Profile { kOff, kNed, kFrd };

/// What is offered on DDS. Domain, interface and peers: NetworkConfig.
struct DdsConfig {
  bool enabled{false};
  std::string prefix;  ///< Before the topics of a body: `/fiducap` gives `/fiducap/<body>/pose`.
  std::string world_frame{"world"};  ///< frame_id of the workspace; a body's own is its name.
  NameAliases aliases;
  bool pose{true};   ///< `/<body>/pose`, geometry_msgs/PoseStamped.
  bool twist{true};  ///< `/<body>/twist`, geometry_msgs/TwistStamped, in the world's axes.
  bool odometry{
      true};      ///< `/<body>/odom`, nav_msgs/Odometry with covariances, twist in the body's axes.
  bool tf{true};  ///< `/tf`: world → body. `/tf_static`: world → settled tags.
  bool poses{true};  ///< `/poses`, NamedPoseArray of motion_capture_tracking (Crazyswarm).
  double poses_deadline_hz{
      100};  ///< Promised for `/poses`: who asks for more is not served; 0: nothing is promised.
  bool rigid_bodies{true};  ///< `/rigid_bodies`, mocap4r2_msgs/RigidBodies.
  bool diagnostics{true};   ///< `/diagnostics`, once a second.
  bool native{true};        ///< `fiducap/bodies` and `fiducap/tags` (proto/dds/fiducap.idl), keyed.
  /// `[/<body>]/fmu/in/vehicle_visual_odometry`; without the body's name when there is only one.
  Px4Profile px4{Px4Profile::kOff};
  double px4_rate_hz{50};
  bool reliable{true};  ///< Also serves subscribers that want no loss; false: best effort only.

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

}  // namespace fiducap::dds
