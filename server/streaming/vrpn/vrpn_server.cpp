#include "streaming/vrpn/vrpn_server.hpp"

#include <utility>

#include "base/log.hpp"
#include "streaming/server_handle.hpp"
#include "streaming/vrpn/server.hpp"

namespace fiducap::vrpn {

namespace {

class Handle final : public ServerHandle<VrpnStreamer, Server> {
 public:
  using ServerHandle::ServerHandle;
  [[nodiscard]] std::uint16_t port() const override { return server().port(); }
};

}  // namespace

Expected<std::unique_ptr<VrpnStreamer>> start_vrpn_server(boost::asio::io_context& io,
                                                          const VrpnConfig& config,
                                                          std::shared_ptr<const SceneModel> model,
                                                          const Clock& clock) {
  auto server = std::make_shared<Server>(io, config, clock);
  if (auto listening = server->listen(*model); !listening) return tl::unexpected(listening.error());
  log::info("vrpn", "serves VRPN 07." + std::to_string(config.minor_version) + " on " +
                        config.address + ":" + std::to_string(server->port()) + " (TCP and UDP)");
  return std::make_unique<Handle>("vrpn", std::move(server));
}

}  // namespace fiducap::vrpn
