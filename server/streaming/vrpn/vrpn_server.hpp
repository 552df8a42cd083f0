#pragma once

#include <cstdint>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vrpn/sender_table.hpp"
#include "streaming/vrpn/vrpn_config.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::vrpn {

class VrpnStreamer : public Streamer {
 public:
  /// The port in use, TCP and UDP; what the configuration says unless that is 0.
  [[nodiscard]] virtual std::uint16_t port() const = 0;
};

/// @param clock  must live until `io` has run out of handlers after stop().
/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] Expected<std::unique_ptr<VrpnStreamer>> start_vrpn_server(
    boost::asio::io_context& io, const VrpnConfig& config, std::shared_ptr<const SceneModel> model,
    const Clock& clock);

}  // namespace fiducap::vrpn
