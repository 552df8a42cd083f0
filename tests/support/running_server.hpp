#pragma once

#include <algorithm>
#include <chrono>
#include <fiducap/client.hpp>
#include <fiducap/control.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "daemon/server.hpp"
#include "daemon/system.hpp"
#include "simulation/simulation.hpp"
#include "support/results.hpp"

namespace fiducap {

/// The shipped demo with ready corners instead of images (a thousandth of the cost) on free ports.
inline ServerConfig corner_demo() {
  const auto file = std::filesystem::path(FIDUCAP_SOURCE_DIR) / "config" / "demo.yaml";
  ServerConfig config = value_of(load_config(
      file.string(), {"streaming.vrpn.port=0", "streaming.native.port=0", "streaming.natnet.port=0",
                      "streaming.vicon.port=0", "streaming.qualisys.base_port=0",
                      "streaming.qualisys.discovery_port=0", "streaming.dds.enabled=false",
                      "streaming.web.port=0", "log_level=warning"}));
  for (auto& body : config.bodies) {
    body.source.simulator.camera.images = false;
    body.source.simulator.faults = {};
  }
  // Simulated corners have more noise than corners of the demo's sharp images.
  config.estimator.corner_noise_px = config.bodies.front().source.simulator.camera.corner_noise_px;
  return config;
}

/// The robots of a configuration as the server simulates them, for their truth.
inline std::vector<std::unique_ptr<simulation::SimulatedSource>> simulated_robots(
    const ServerConfig& config, Instant start) {
  std::vector<std::unique_ptr<simulation::SimulatedSource>> robots;
  for (const BodyConfig& body : config.bodies) {
    auto robot = body.source.simulator;
    if (robot.cameras.empty())
      for (const auto& camera : body.cameras) robot.cameras.push_back(camera.mount);
    robots.push_back(
        value_of(simulation::make_simulated_source(config.simulation, robot, start, nullptr)));
  }
  return robots;
}

/// Waits for a condition, at most a minute. @return whether it holds
template <typename Condition>
bool wait_until(Condition condition) {
  for (int i = 0; i < 1200; ++i, std::this_thread::sleep_for(std::chrono::milliseconds(50)))
    if (condition()) return true;
  return condition();
}

/// Calls `each` for every frame of the client until it returns true. @return false after a timeout
template <typename Each>
bool follow(const Client& client, std::chrono::seconds timeout, Each each) {
  const auto until = std::chrono::steady_clock::now() + timeout;
  Frame frame;
  while (std::chrono::steady_clock::now() < until) {
    if (!client.wait_for_frame(frame.number, std::chrono::milliseconds(100)) ||
        !client.latest(frame))
      continue;
    if (each(frame)) return true;
  }
  return false;
}

/// The frame has that number of bodies, and all are tracked.
inline bool all_tracked(const Frame& frame, std::size_t count) {
  return frame.bodies.size() == count &&
         std::all_of(frame.bodies.begin(), frame.bodies.end(), [](const Body& body) {
           return body.valid && body.tracking == Tracking::kTracking;
         });
}

/// A server on a thread of its own; stopped at the end.
class RunningServer final {
 public:
  /// @param first  done on the server's thread before it runs
  explicit RunningServer(
      const ServerConfig& config, const ServerOptions& options = {},
      std::function<void()> first = [] {}) {
    server_ = value_of(Server::build(config, options, clock_));
    thread_ = std::jthread([this, first = std::move(first)] {
      first();
      clean_ = server_->run() == ServerEnd::kClean;
    });
  }
  ~RunningServer() { stop(); }
  RunningServer(const RunningServer&) = delete;
  RunningServer& operator=(const RunningServer&) = delete;

  [[nodiscard]] ClientOptions client_options() const {
    ClientOptions options;
    options.port = server_->ports().native;
    return options;
  }
  [[nodiscard]] ControlOptions control_options(const std::string& token) const {
    ControlOptions options;
    options.port = server_->ports().native;
    options.token = token;
    return options;
  }

  /// @return the time that the server took to end
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
