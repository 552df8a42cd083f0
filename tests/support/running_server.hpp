#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <thread>

#include "daemon/server.hpp"
#include "daemon/system.hpp"

namespace fiducap {

/// The shipped demo with ready corners instead of images (a thousandth of the cost) on free ports.
inline ServerConfig corner_demo() {
  const auto file = std::filesystem::path(FIDUCAP_SOURCE_DIR) / "config" / "demo.yaml";
  auto config = load_config(
      file.string(), {"streaming.vrpn.port=0", "streaming.native.port=0", "streaming.natnet.port=0",
                      "streaming.vicon.port=0", "streaming.qualisys.base_port=0",
                      "streaming.qualisys.discovery_port=0", "streaming.dds.enabled=false",
                      "streaming.web.port=0", "log_level=warning"});
  if (!config) throw std::runtime_error(config.error().front().text());
  for (auto& body : config->bodies) {
    body.source.simulator.camera.images = false;
    body.source.simulator.faults = {};
  }
  // Corners alone come with more noise than a detector finds in the demo's sharp images.
  config->estimator.corner_noise_px =
      config->bodies.front().source.simulator.camera.corner_noise_px;
  return *config;
}

/// A server on a thread of its own; stopped at the end.
class RunningServer final {
 public:
  /// @param first  done on the server's thread before it runs
  explicit RunningServer(
      const ServerConfig& config, const ServerOptions& options = {},
      std::function<void()> first = [] {}) {
    auto built = Server::build(config, options, clock_);
    if (!built) throw std::runtime_error(built.error().text());
    server_ = std::move(*built);
    thread_ = std::jthread([this, first = std::move(first)] {
      first();
      clean_ = server_->run() == ServerEnd::kClean;
    });
  }
  ~RunningServer() { stop(); }
  RunningServer(const RunningServer&) = delete;
  RunningServer& operator=(const RunningServer&) = delete;

  /// @return how long the server took to end.
  Duration stop() {
    const Instant begin = clock_.now();
    server_->stop();
    if (thread_.joinable()) thread_.join();
    return clock_.now() - begin;
  }
  void wait() { thread_.join(); }
  [[nodiscard]] bool clean() const { return clean_; }
  Server& operator*() { return *server_; }
  Server* operator->() { return server_.get(); }

 private:
  SystemClock clock_;
  std::unique_ptr<Server> server_;
  bool clean_{false};
  std::jthread thread_;
};

}  // namespace fiducap
