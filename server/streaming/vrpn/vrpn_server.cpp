#include "streaming/vrpn/vrpn_server.hpp"

#include <utility>

#include "base/log.hpp"
#include "streaming/vrpn/server.hpp"

namespace fiducap::vrpn {

namespace {

/// The server outlives this handle until its last handler has run.
class Handle final : public VrpnStreamer {
 public:
  explicit Handle(std::shared_ptr<Server> server) : server_(std::move(server)) {}
  ~Handle() override { server_->stop(); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  [[nodiscard]] std::string_view protocol() const override { return "vrpn"; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override { server_->publish(*frame); }
  void append_clients(std::vector<ClientStatus>& out) const override { server_->append_clients(out); }
  void stop() override { server_->stop(); }
  [[nodiscard]] std::uint16_t port() const override { return server_->port(); }

 private:
  std::shared_ptr<Server> server_;
};

}  // namespace

Expected<std::unique_ptr<VrpnStreamer>> start_vrpn_server(boost::asio::io_context& io, const VrpnConfig& config,
                                                          std::shared_ptr<const SceneModel> model,
                                                          const Clock& clock) {
  auto server = std::make_shared<Server>(io, config, clock);
  if (auto listening = server->listen(*model); !listening) return tl::unexpected(listening.error());
  log::info("vrpn", "serves VRPN 07." + std::to_string(config.minor_version) + " on " + config.address + ":" +
                        std::to_string(server->port()) + " (TCP and UDP)");
  return std::make_unique<Handle>(std::move(server));
}

}  // namespace fiducap::vrpn
