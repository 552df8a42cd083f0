#pragma once

#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vrpn/vrpn_config.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::vrpn {

using VrpnStreamer = Streamer;

/// @param clock  must live until `io` has run out of handlers after stop().
/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] Expected<std::unique_ptr<VrpnStreamer>> start_vrpn_server(
    boost::asio::io_context& io, const VrpnConfig& config, std::shared_ptr<const SceneModel> model,
    const Clock& clock);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const VrpnConfig& config) {
  return start_vrpn_server(context.io, config, context.model, context.clock);
}

}  // namespace fiducap::vrpn
