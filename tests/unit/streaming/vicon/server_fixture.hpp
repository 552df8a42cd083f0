#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "streaming/vicon/vicon_server.hpp"
#include "strict_client.hpp"
#include "support/server_stage.hpp"

namespace fiducap::vicon {

/// Server and clients on real loopback sockets, all in this thread.
class ViconServerTest : public ServerStage<StrictClient> {
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
  void publish() { server_->publish(frame()); }

  [[nodiscard]] std::vector<ClientStatus> status() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  ViconConfig config_;
  std::uint16_t port_{0};
  std::unique_ptr<ViconStreamer> server_;
};

}  // namespace fiducap::vicon
