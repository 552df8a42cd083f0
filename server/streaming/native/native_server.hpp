#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "streaming/streamer.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::native {

struct NativeConfig {
  bool enabled{true};
  std::string address{"127.0.0.1"};
  std::uint16_t port{21600};         ///< UDP. 0: any free one, see `bound_port`.
  int max_clients{64};
  int max_clients_per_address{16};
  double lease_s{3.0};               ///< A client that does not renew within this time is forgotten.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Native protocol (`proto/fiducap/v1/`): subscriptions with a lease in, frames out, one UDP socket.
/// @return Error `kUnavailable` naming address, port and remedy when it cannot bind; `kInvalid` when the scene has more
///         bodies than the protocol carries.
[[nodiscard]] Expected<std::unique_ptr<Streamer>> start_native_server(boost::asio::io_context& io,
                                                                       const NativeConfig& config,
                                                                       std::shared_ptr<const SceneModel> model,
                                                                       const Clock& clock);

/// Where it really listens. @pre made by start_native_server
[[nodiscard]] std::uint16_t bound_port(const Streamer& native_server);

}  // namespace fiducap::native
