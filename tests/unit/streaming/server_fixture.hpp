#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "streaming/streamer.hpp"
#include "support/server_stage.hpp"

namespace fiducap {

/// A protocol server and its clients on real loopback sockets, all in this thread.
/// @tparam Client  has pump()   @tparam Config  of the protocol
template <class Client, class Config>
class ProtocolServerTest : public ServerStage<Client> {
 protected:
  ~ProtocolServerTest() override {
    if (server_) server_->stop();
    this->io_.restart();
    this->io_.run();
  }
  [[nodiscard]] virtual Expected<std::unique_ptr<Streamer>> make_server(
      std::shared_ptr<const SceneModel> model) = 0;

  void start(const std::vector<std::string>& bodies = {"arm", "drone"}) {
    this->names_ = bodies;
    config_.port = port_;
    auto server = make_server(make_scene_frame(bodies)->model);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    port_ = server_->port();
    ASSERT_GT(port_, 0);
  }
  void publish() { server_->publish(this->frame()); }

  [[nodiscard]] std::vector<ClientStatus> status() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  Config config_;
  std::uint16_t port_{0};
  std::unique_ptr<Streamer> server_;
};

}  // namespace fiducap
