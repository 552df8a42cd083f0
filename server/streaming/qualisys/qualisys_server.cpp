#include "streaming/qualisys/qualisys_server.hpp"

#include <string>
#include <utility>

#include "base/log.hpp"
#include "streaming/qualisys/server.hpp"

namespace fiducap::qualisys {

namespace {

/// The server outlives this handle until its last handler has run.
class Handle final : public QualisysStreamer {
 public:
  explicit Handle(std::shared_ptr<Server> server) : server_(std::move(server)) {}
  ~Handle() override { server_->stop(); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  [[nodiscard]] std::string_view protocol() const override { return "qualisys"; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override { server_->publish(frame); }
  void append_clients(std::vector<ClientStatus>& out) const override {
    server_->append_clients(out);
  }
  void stop() override { server_->stop(); }
  [[nodiscard]] std::uint16_t base_port() const override { return server_->base_port(); }
  [[nodiscard]] std::uint16_t discovery_port() const override { return server_->discovery_port(); }

 private:
  std::shared_ptr<Server> server_;
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
  return std::make_unique<Handle>(std::move(server));
}

}  // namespace fiducap::qualisys
