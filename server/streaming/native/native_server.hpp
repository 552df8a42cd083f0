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
  std::uint16_t port{21600};         ///< UDP.
  int max_clients{64};
  int max_clients_per_address{16};
  double lease_s{3.0};               ///< A client that does not renew within this time is forgotten.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

[[nodiscard]] Expected<std::unique_ptr<Streamer>> start_native_server(boost::asio::io_context& io,
                                                                       const NativeConfig& config,
                                                                       std::shared_ptr<const SceneModel> model,
                                                                       const Clock& clock);

}  // namespace fiducap::native
