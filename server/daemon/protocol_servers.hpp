#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "base/clock.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/stream_loop.hpp"
#include "middleware/participant.hpp"
#include "streaming/camera_views.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/operator_desk.hpp"
#include "streaming/setup_desk.hpp"

namespace fiducap {

/// Where the protocols really listen (a configured 0 is any free port); 0: not served.
using ServerPorts = ProtocolPorts;

/// What the protocol servers live on; everything outlives the two loops.
struct ProtocolParts {
  StreamLoop& frames;
  StreamLoop& pages;  ///< For those whose configuration says `kCanWait`.
  const ServerConfig& config;
  std::shared_ptr<const SceneModel> model;
  OperatorDesk& desk;
  const EventBoard& events;
  const Clock& clock;
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds;
  CameraViews* views{};  ///< nullptr: there are no pictures.
  SetupDesk* setup{};    ///< nullptr: no set-up goes on.
};

/// Starts every enabled protocol in its loop. One of `streaming.optional` that cannot
/// start is a warning with the remedy, any other an error.
[[nodiscard]] Expected<ServerPorts> start_protocols(const ProtocolParts& parts);

/// Where each protocol of a configuration that has a port listens, and what its clients receive.
[[nodiscard]] std::vector<ServedProtocol> served_protocols(const StreamingConfig& streaming);

}  // namespace fiducap
