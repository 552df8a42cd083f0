#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "streaming/vrpn/vrpn_server.hpp"
#include "strict_client.hpp"
#include "support/server_stage.hpp"

namespace fiducap::vrpn {

/// Server and clients on real loopback sockets, all in this thread.
class VrpnServerTest : public ServerStage<StrictClient> {
 protected:
  ~VrpnServerTest() override {
    if (server_) server_->stop();
    io_.restart();
    io_.run();
  }

  void start(const std::vector<std::string>& bodies = {"arm", "drone"}) {
    names_ = bodies;
    config_.port = port_;
    auto server = start_vrpn_server(io_, config_, make_scene_frame(bodies)->model, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    port_ = server_->port();
    ASSERT_GT(port_, 0);
  }
  void publish() { server_->publish(frame()); }

  [[nodiscard]] std::vector<ClientStatus> status() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  VrpnConfig config_;
  std::uint16_t port_{0};
  std::unique_ptr<VrpnStreamer> server_;
};

}  // namespace fiducap::vrpn
