#pragma once

#include <cstdint>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/native/native_config.hpp"
#include "streaming/operator_desk.hpp"
#include "streaming/streamer.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::native {

/// Native protocol (`proto/fiducap/v1/`): subscriptions with a lease in, frames out, one UDP
/// socket; commands by TCP.
/// @param desk  carries out commands; nullptr: there is no control channel
/// @return Error `kUnavailable` naming address, port and remedy when it cannot bind; `kInvalid`
/// when the scene has more
///         bodies than the protocol carries.
[[nodiscard]] Expected<std::unique_ptr<Streamer>> start_native_server(
    boost::asio::io_context& io, const NativeConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock, OperatorDesk* desk = nullptr,
    const EventBoard* events = nullptr);

/// Where it really listens.
[[nodiscard]] inline std::uint16_t bound_port(const Streamer& server) { return server.port(); }

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const NativeConfig& config) {
  return start_native_server(context.io, config, context.model, context.clock, &context.desk,
                             &context.events);
}

}  // namespace fiducap::native
