#pragma once

#include <cstdint>
#include <functional>
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

namespace fiducap::web {

struct WebConfig {
  bool enabled{true};
  std::string address{"127.0.0.1"};
  std::uint16_t port{8080};  ///< 0: any free port, see WebServer::port.
  double rate_hz{20.0};      ///< Frames to a page; a browser needs no more.
  int max_clients{32};       ///< Live pages at once; the next one is told to come later.
  std::string root;          ///< Folder of the bundled page; empty: beside the program.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// What the page shows besides frames.
struct WebSources {
  std::function<std::vector<ClientStatus>()>
      clients;  ///< Of all protocols; called on the I/O thread, once a second.
  std::string server_name{"fiducapd"};
  std::string version;
  std::function<std::string()> map_mode;  ///< `mapping` or `frozen`, as it is now.
};

/// The page's server. All calls on the I/O thread; a page that reads too slowly loses frames, then
/// its connection.
class WebServer final : public Streamer {
 public:
  class Impl;
  explicit WebServer(std::shared_ptr<Impl> impl);
  ~WebServer() override;
  [[nodiscard]] std::string_view protocol() const override { return "web"; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override;
  void append_clients(std::vector<ClientStatus>& out) const override;
  void stop() override;
  /// The bound port, also when the configuration asked for any free one.
  [[nodiscard]] std::uint16_t port() const;

 private:
  std::shared_ptr<Impl> impl_;
};

/// HTTP (page, `/api/v1/state` JSON, `/healthz`) and WebSocket (`/api/v1/live`), same origin.
/// @return Error with a remedy when the address cannot be bound.
[[nodiscard]] Expected<std::unique_ptr<WebServer>> start_web_server(
    boost::asio::io_context& io, const WebConfig& config, WebSources sources,
    std::shared_ptr<const SceneModel> model, const Clock& clock);

}  // namespace fiducap::web
