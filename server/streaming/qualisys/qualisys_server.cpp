#include "streaming/qualisys/qualisys_server.hpp"

#include <string>
#include <utility>

#include "base/log.hpp"
#include "streaming/qualisys/server.hpp"
#include "streaming/server_handle.hpp"

namespace fiducap::qualisys {

namespace {

class Handle final : public ServerHandle<QualisysStreamer, Server> {
 public:
  using ServerHandle::ServerHandle;
  [[nodiscard]] std::uint16_t base_port() const override { return server().base_port(); }
  [[nodiscard]] std::uint16_t discovery_port() const override { return server().discovery_port(); }
};

}  // namespace

Expected<std::unique_ptr<QualisysStreamer>> start_qualisys_server(
    boost::asio::io_context& io, const QualisysConfig& config, OperatorDesk* desk,
    std::shared_ptr<const SceneModel> model, const Clock& clock) {
  auto server = std::make_shared<Server>(io, config, desk, clock);
  if (auto listening = server->listen(*model); !listening) {
    return tl::unexpected(listening.error());
  }
  const std::uint16_t base = server->base_port();
  log::info("qualisys", "serves QTM RT 1.0 to 1.28 on " + config.address + ":" +
                            std::to_string(base) + " to " + std::to_string(base + 2) + " (TCP)");
  return std::make_unique<Handle>("qualisys", std::move(server));
}

}  // namespace fiducap::qualisys
