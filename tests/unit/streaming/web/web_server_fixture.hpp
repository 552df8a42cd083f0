#pragma once

#include <gmock/gmock.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "loopback_client.hpp"
#include "streaming/web/web.hpp"
#include "support/fake_clock.hpp"
#include "temporary_page.hpp"

namespace fiducap::web {

/// A server of a small page and its clients on loopback, all in this thread.
class WebServerFixture : public testing::Test {
 protected:
  void TearDown() override { server_.reset(); }
  /// With `config_` and `context_`; replaces the server of before.
  void start() {
    server_.reset();
    config_.port = 0;
    config_.root = files_.root().string();
    config_.hosts = {"hall"};
    auto started = serve(context_, config_);
    ASSERT_TRUE(started.has_value()) << started.error().text();
    server_ = std::move(*started);
  }
  /// @param from  of 127.0.0.0/8: each is an address of its own
  LoopbackClient client(const char* from = "127.0.0.1", int receive_buffer = 0) {
    return {io_, server_->port(), receive_buffer, from};
  }
  /// A client that has requested a WebSocket at `path_`.
  LoopbackClient upgrading(const std::string& headers = "", const char* from = "127.0.0.1",
                           int receive_buffer = 0) {
    auto peer = client(from, receive_buffer);
    peer.upgrade(headers, path_);
    return peer;
  }
  /// A client with an open WebSocket.
  LoopbackClient upgraded(const std::string& headers = "", const char* from = "127.0.0.1",
                          int receive_buffer = 0) {
    auto peer = upgrading(headers, from, receive_buffer);
    EXPECT_TRUE(peer.wait_for_upgrade()) << peer.received();
    return peer;
  }
  /// @return the whole answer
  std::string get(const std::string& target, const std::string& headers = "") {
    auto peer = client();
    peer.get(target, headers + "Connection: close\r\n");
    EXPECT_TRUE(peer.wait_for_close());
    return peer.received();
  }
  std::vector<ClientStatus> clients() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  TemporaryPage files_;
  WebConfig config_;
  ProtocolContext context_{io_, std::make_shared<SceneModel>(), clock_};
  std::string path_{"/api/v1/live"};
  std::unique_ptr<Streamer> server_;
};

}  // namespace fiducap::web
