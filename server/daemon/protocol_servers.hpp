#pragma once

#include <functional>
#include <memory>

#include "base/clock.hpp"
#include "daemon/config/config_file.hpp"
#include "middleware/participant.hpp"
#include "streaming/stream_hub.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap {

/// Where the protocols really listen (a configured 0 is any free port); 0: not served.
struct ServerPorts {
  std::uint16_t vrpn{};
  std::uint16_t native{};
  std::uint16_t natnet{};
  std::uint16_t vicon{};
  std::uint16_t qualisys{};  ///< Base port.
  std::uint16_t web{};
};

/// What the protocol servers live on; everything outlives the hub.
struct ProtocolParts {
  boost::asio::io_context& io;
  const ServerConfig& config;
  std::shared_ptr<const SceneModel> model;
  OperatorDesk& desk;
  const Clock& clock;
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds;
};

/// The names that `streaming.optional` may hold.
[[nodiscard]] const std::vector<std::string>& protocol_names();

/// Starts every enabled protocol and gives it to the hub. One of `streaming.optional` that cannot
/// start is a warning with the remedy, any other an error.
[[nodiscard]] Expected<ServerPorts> start_protocols(const ProtocolParts& parts, StreamHub& hub);

}  // namespace fiducap
