#include "streaming/vicon/vicon_server.hpp"

#include <string>
#include <utility>

#include "base/log.hpp"
#include "streaming/vicon/server.hpp"

namespace fiducap::vicon {

namespace {

/// The server outlives this handle until its last handler has run.
class Handle final : public ViconStreamer {
 public:
  explicit Handle(std::shared_ptr<Server> server) : server_(std::move(server)) {}
  ~Handle() override { server_->stop(); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  [[nodiscard]] std::string_view protocol() const override { return "vicon"; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override { server_->publish(*frame); }
  void append_clients(std::vector<ClientStatus>& out) const override { server_->append_clients(out); }
  void stop() override { server_->stop(); }
  [[nodiscard]] std::uint16_t port() const override { return server_->port(); }

 private:
  std::shared_ptr<Server> server_;
};

}  // namespace

Expected<std::unique_ptr<ViconStreamer>> start_vicon_server(boost::asio::io_context& io, const ViconConfig& config,
                                                            const Clock& clock) {
  auto server = std::make_shared<Server>(io, config, clock);
  if (auto listening = server->listen(); !listening) return tl::unexpected(listening.error());
  log::info("vicon", "serves the Vicon DataStream on " + config.address + ":" + std::to_string(server->port()) + " (TCP)");
  return std::make_unique<Handle>(std::move(server));
}

}  // namespace fiducap::vicon
