#pragma once

#include <cstdint>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/operator_desk.hpp"
#include "streaming/qualisys/qualisys_config.hpp"
#include "streaming/streamer.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::qualisys {

class QualisysStreamer : public Streamer {
 public:
  /// The base port in use; what the configuration says unless that is 0.
  [[nodiscard]] std::uint16_t base_port() const { return port(); }
  /// 0: discovery is not answered.
  [[nodiscard]] virtual std::uint16_t discovery_port() const = 0;
};

/// @param desk  outlives the streamer; null: nobody can take control
/// @param clock  must live until `io` has run out of handlers after stop().
/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] Expected<std::unique_ptr<QualisysStreamer>> start_qualisys_server(
    boost::asio::io_context& io, const QualisysConfig& config, OperatorDesk* desk,
    std::shared_ptr<const SceneModel> model, const Clock& clock);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const QualisysConfig& config) {
  return start_qualisys_server(context.io, config, &context.desk, context.model, context.clock);
}

}  // namespace fiducap::qualisys
