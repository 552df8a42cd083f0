#pragma once

#include <cstdint>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vicon/vicon_config.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::vicon {

class ViconStreamer : public Streamer {
 public:
  /// The TCP port in use; what the configuration says unless that is 0.
  [[nodiscard]] virtual std::uint16_t port() const = 0;
};

/// @param clock  must live until `io` has run out of handlers after stop().
/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] Expected<std::unique_ptr<ViconStreamer>> start_vicon_server(boost::asio::io_context& io,
                                                                          const ViconConfig& config,
                                                                          const Clock& clock);

}  // namespace fiducap::vicon
