#pragma once

#include <cstdint>
#include <memory>

#include <boost/asio/io_context.hpp>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/mavlink/mavlink_config.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::mavlink {

/// Poses for autopilots, one UDP socket for all.
class MavlinkStreamer : public Streamer {
 public:
  [[nodiscard]] virtual std::uint16_t port() const = 0;
};

/// @return Error `kUnavailable` naming port and remedy when it cannot bind
[[nodiscard]] Expected<std::unique_ptr<MavlinkStreamer>> start_mavlink_server(
    boost::asio::io_context& io, const MavlinkConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock);

}  // namespace fiducap::mavlink
