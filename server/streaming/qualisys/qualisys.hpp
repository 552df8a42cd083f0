#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/operator_api.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::qualisys {

struct QualisysConfig {
  bool enabled{false};
  std::string address{"127.0.0.1"};  ///< IPv4. 0.0.0.0: all interfaces.
  /// TCP: this one for protocol 1.0, +1 little-endian, +2 big-endian. 0: any free ones.
  std::uint16_t base_port{22222};
  std::uint16_t discovery_port{22226};  ///< UDP, for discovery by broadcast. 0: none.
  int max_clients{64};
  int max_clients_per_address{32};
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  /// `hold`: the last valid pose instead of NaN. Bodies are identified by index: `stop` is `flag`.
  WhenInvalid when_invalid{WhenInvalid::kFlag};
  NameAliases aliases;
  std::string qtm_version{"2.17 (build 4050)"};  ///< For QTMVersion and discovery.

  [[nodiscard]] OutputAxes axes() const { return {up, scope, 1000.0}; }
  [[nodiscard]] std::vector<ConfigError> check() const;
  [[nodiscard]] ServedProtocol served() const;
};

template <class V>
void describe(V& v, QualisysConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("base_port", c.base_port);
  v.value("discovery_port", c.discovery_port);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.word("up", c.up, words::kUpAxis);
  v.word("scope", c.scope, words::kAxesScope);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
  v.value("aliases", c.aliases);
  v.value("qtm_version", c.qtm_version);
}

using ProtocolConfig = QualisysConfig;

class QualisysStreamer : public Streamer {
 public:
  /// The base port in use.
  [[nodiscard]] std::uint16_t base_port() const { return port(); }
  /// 0: no discovery.
  [[nodiscard]] virtual std::uint16_t discovery_port() const = 0;
};

/// @param operator_api  outlives the streamer; nullptr: no client can take control
/// @param clock  outlives all handlers of `io`
/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] Expected<std::unique_ptr<QualisysStreamer>> start_qualisys_server(
    boost::asio::io_context& io, const QualisysConfig& config, OperatorApi* operator_api,
    std::shared_ptr<const SceneModel> model, const Clock& clock);

/// For the list of protocols (streaming/CMakeLists.txt).
[[nodiscard]] inline StartedStreamer serve(const ProtocolContext& context,
                                           const QualisysConfig& config) {
  return start_qualisys_server(context.io, config, &context.operator_api, context.model,
                               context.clock);
}

}  // namespace fiducap::qualisys
