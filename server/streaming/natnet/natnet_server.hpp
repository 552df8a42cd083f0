#pragma once

#include <cstdint>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/natnet/natnet_config.hpp"
#include "streaming/streamer.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::natnet {

/// What the hub owns.
class NatNetStreamer : public Streamer {
 public:
  /// The second command port, where clients are told of no group; 0: there is none.
  [[nodiscard]] virtual std::uint16_t unicast_port() const = 0;
};

/// NatNet: commands in by UDP, frames out by UDP, to each client that asked or to a multicast
/// group, or both.
/// @param desk  for commands that change something; nullptr: none does. Outlives the server.
/// @param rate_hz  of frames, until the first one says its own
/// @return Error naming address, port and remedy when it cannot bind, `kInvalid` when the scene has
/// more bodies than
///         NatNet clients take
[[nodiscard]] Expected<std::unique_ptr<NatNetStreamer>> start_natnet_server(
    boost::asio::io_context& io, const NatNetConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock, OperatorDesk* desk,
    double rate_hz);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const NatNetConfig& config) {
  return start_natnet_server(context.io, config, context.model, context.clock, &context.desk,
                             context.rate_hz);
}

}  // namespace fiducap::natnet
