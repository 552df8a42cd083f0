#pragma once

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "streaming/streamer.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {

/// A server and its clients on real loopback sockets, all in this thread.
/// @tparam Client  has pump()
template <class Client>
class ServerStage : public testing::Test {
 protected:
  ~ServerStage() override { end_server(); }
  /// For derived classes that own what the server uses.
  void end_server() {
    if (!server_) return;
    server_->stop();
    io_.restart();
    io_.run();
    server_.reset();
  }
  std::shared_ptr<SceneFrame> frame() { return make_scene_frame(names_, ++number_); }
  void publish() { server_->publish(frame()); }
  [[nodiscard]] std::vector<ClientStatus> status() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  void step() {
    io_.restart();
    io_.run_for(std::chrono::milliseconds(1));
    io_.restart();
    io_.poll();  // on a busy machine the millisecond may be over before the first handler
    for (auto* client : clients_) client->pump();
  }
  void steps(int n) {
    for (int i = 0; i < n; ++i) step();
  }
  [[nodiscard]] bool until(const std::function<bool()>& holds) {
    constexpr auto kTimeout = std::chrono::seconds(120);  // a test that hangs has failed
    const auto end = std::chrono::steady_clock::now() + kTimeout;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > end) return false;
      step();
    }
    return true;
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  std::vector<std::string> names_{"arm", "drone"};
  std::uint64_t number_{0};
  std::vector<Client*> clients_;
  std::unique_ptr<Streamer> server_;
};

/// @tparam Config  of the protocol
template <class Client, class Config>
class ProtocolServerTest : public ServerStage<Client> {
 protected:
  void start(const std::vector<std::string>& bodies = {"arm", "drone"}) {
    this->names_ = bodies;
    config_.port = 0;
    auto server = serve({this->io_, make_scene_frame(bodies)->model, this->clock_}, config_);
    ASSERT_TRUE(server) << server.error().text();
    this->server_ = std::move(*server);
    port_ = this->server_->port();
    ASSERT_GT(port_, 0);
  }

  Config config_;
  std::uint16_t port_{0};
};

}  // namespace fiducap
