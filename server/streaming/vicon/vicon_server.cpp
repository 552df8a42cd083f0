#include "streaming/vicon/vicon_server.hpp"

#include <string>
#include <utility>

#include "base/log.hpp"
#include "streaming/server_handle.hpp"
#include "streaming/vicon/server.hpp"

namespace fiducap::vicon {

namespace {

class Handle final : public ServerHandle<ViconStreamer, Server> {
 public:
  using ServerHandle::ServerHandle;
  [[nodiscard]] std::uint16_t port() const override { return server().port(); }
};

}  // namespace

Expected<std::unique_ptr<ViconStreamer>> start_vicon_server(boost::asio::io_context& io,
                                                            const ViconConfig& config,
                                                            const Clock& clock) {
  auto server = std::make_shared<Server>(io, config, clock);
  if (auto listening = server->listen(); !listening) return tl::unexpected(listening.error());
  log::info("vicon", "serves the Vicon DataStream on " + config.address + ":" +
                         std::to_string(server->port()) + " (TCP)");
  return std::make_unique<Handle>("vicon", std::move(server));
}

}  // namespace fiducap::vicon
