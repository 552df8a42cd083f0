#pragma once

#include <gmock/gmock.h>

#include <set>
#include <span>
#include <vector>

#include "client_packets.hpp"
#include "stream_view.hpp"
#include "streaming/vicon/vicon.hpp"
#include "support/loopback_socket.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap::vicon {

/// A client that shares no code with the server. It asks like SDK 1.12 does: types after the
/// greeting, then frames. `pump` reads all that came.
class StrictClient final {
 public:
  StrictClient() = default;
  ~StrictClient() {
    if (socket_ >= 0) ::close(socket_);
  }
  StrictClient(const StrictClient&) = delete;
  StrictClient& operator=(const StrictClient&) = delete;

  void connect(std::uint16_t port) { socket_ = connected_socket(port); }
  void pump() {
    if (!reading_ || closed_) return;
    closed_ = !read_stream(socket_, in_);
    const std::size_t used = view.take(in_);
    in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
  }
  /// Replaces the requested types.
  void want(const std::set<std::uint32_t>& types) {
    view.requested = types;
    send(client::types(types));
  }
  void send(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t n = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (n <= 0) return;  // closed, or the server does not read: tests check what comes back
      bytes = bytes.subspan(static_cast<std::size_t>(n));
    }
  }
  void stop_reading() { reading_ = false; }
  void resume_reading() { reading_ = true; }
  [[nodiscard]] bool closed_by_server() const { return closed_; }

  StreamView view;

 private:
  int socket_{-1};
  bool reading_{true};
  bool closed_{false};
  std::vector<std::byte> in_;
};

class ViconServerTest : public ProtocolServerTest<StrictClient, ViconConfig> {
 protected:
  Expected<std::unique_ptr<Streamer>> make_server(std::shared_ptr<const SceneModel>) override {
    return start_vicon_server(io_, config_, clock_);
  }
  void TearDown() override { EXPECT_THAT(client_.view.violations, testing::IsEmpty()); }
  /// Connected and greeted, with the types sent.
  void open(StrictClient& client, const std::set<std::uint32_t>& types = client::kSegments) {
    client.connect(port_);
    clients_.push_back(&client);
    ASSERT_TRUE(until([&] { return client.view.greeted; }));
    client.want(types);
    steps(3);
  }
  /// As `open`, with every frame requested.
  void open_push(StrictClient& client, const std::set<std::uint32_t>& types = client::kSegments) {
    open(client, types);
    client.send(client::request_frame(true));
    steps(3);
  }
  /// Sends `scene`, by default the next frame, and waits until the client has `frames` in total.
  void publish_to(StrictClient& client, int frames, std::shared_ptr<SceneFrame> scene = nullptr) {
    server_->publish(scene ? scene : frame());
    ASSERT_TRUE(until([&] { return client.view.frames == frames; }));
  }

  StrictClient client_;  ///< Must find no violation.
};

}  // namespace fiducap::vicon
