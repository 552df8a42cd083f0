#pragma once

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "strict_client.hpp"
#include "streaming/vicon/vicon_server.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vicon {

// A test that hangs has failed; nothing below waits this long otherwise.
inline constexpr auto kHang = std::chrono::seconds(20);

/// Server and clients on real loopback sockets, all in this thread.
class ViconServerTest : public testing::Test {
 protected:
  ~ViconServerTest() override {
    if (server_) server_->stop();
    io_.restart();
    io_.run();
  }

  void start(const std::vector<std::string>& bodies = {"arm", "drone"}) {
    names_ = bodies;
    config_.port = port_;
    auto server = start_vicon_server(io_, config_, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    port_ = server_->port();
    ASSERT_GT(port_, 0);
  }
  /// Connected, greeted, and the types said.
  void open(StrictClient& client, const std::set<std::uint32_t>& types = client::kSegments) {
    client.connect(port_);
    clients_.push_back(&client);
    ASSERT_TRUE(until([&] { return client.view.greeted; }));
    client.want(types);
    steps(3);
  }
  std::shared_ptr<SceneFrame> frame() { return make_scene_frame(names_, ++number_); }
  void publish() { server_->publish(frame()); }

  void step() {
    io_.restart();
    io_.run_for(std::chrono::milliseconds(1));
    for (auto* client : clients_) client->pump();
  }
  [[nodiscard]] bool until(const std::function<bool()>& holds) {
    const auto end = std::chrono::steady_clock::now() + kHang;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > end) return false;
      step();
    }
    return true;
  }
  void steps(int n) {
    for (int i = 0; i < n; ++i) step();
  }
  /// Time passes for the server only; its housekeeping runs every 100 ms of real time.
  void pass(Duration d) {
    clock_.advance(d);
    steps(150);
  }
  [[nodiscard]] std::vector<ClientStatus> status() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  ViconConfig config_;
  std::uint16_t port_{0};
  std::vector<std::string> names_;
  std::uint64_t number_{0};
  std::unique_ptr<ViconStreamer> server_;
  std::vector<StrictClient*> clients_;
};

}  // namespace fiducap::vicon
