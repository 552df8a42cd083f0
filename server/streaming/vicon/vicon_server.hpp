#pragma once

#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vicon/vicon_config.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::vicon {

using ViconStreamer = Streamer;

/// @param clock  must live until `io` has run out of handlers after stop().
/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] Expected<std::unique_ptr<ViconStreamer>> start_vicon_server(
    boost::asio::io_context& io, const ViconConfig& config, const Clock& clock);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const ViconConfig& config) {
  return start_vicon_server(context.io, config, context.clock);
}

}  // namespace fiducap::vicon
