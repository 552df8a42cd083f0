#pragma once

#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/mavlink/mavlink_config.hpp"
#include "streaming/streamer.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::mavlink {

using MavlinkStreamer = Streamer;

/// Poses for autopilots, one UDP socket for all.
/// @return Error `kUnavailable` naming port and remedy when it cannot bind
[[nodiscard]] Expected<std::unique_ptr<MavlinkStreamer>> start_mavlink_server(
    boost::asio::io_context& io, const MavlinkConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const MavlinkConfig& config) {
  return start_mavlink_server(context.io, config, context.model, context.clock);
}

}  // namespace fiducap::mavlink
