#include "streaming/vicon/vicon.hpp"

#include <gmock/gmock.h>

#include "base/log.hpp"
#include "client_packets.hpp"
#include "stream_view.hpp"
#include "support/allocation_counter.hpp"
#include "support/loopback_socket.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap::vicon {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;
using testing::SizeIs;

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
    if (!reading_) return;
    if (!read_stream(socket_, in_)) view.violations.emplace_back("closed");
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

  StreamView view;

 private:
  int socket_{-1};
  bool reading_{true};
  std::vector<std::byte> in_;
};

class ViconServerTest : public ProtocolServerTest<StrictClient, ViconConfig> {
 protected:
  void TearDown() override { EXPECT_THAT(client_.view.violations, IsEmpty()); }
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

TEST_F(ViconServerTest, PushesEveryFrame) {
  start();
  open_push(client_);
  for (int i = 1; i <= 20; ++i) publish_to(client_, i);
  EXPECT_EQ(client_.view.frames_with_statics, 1);
  EXPECT_THAT(client_.view.names, ElementsAre(Pair(1, "arm"), Pair(2, "drone")));
  EXPECT_EQ(client_.view.globals[1].t[0], 1000.0);
  EXPECT_EQ(client_.view.frame_id, 19u);
  EXPECT_EQ(status().at(0).frames_sent, 20u);
}

TEST_F(ViconServerTest, AnswersAPullWithTheNewestFrameOnceAndThenWithTheNext) {
  start();
  open(client_);
  publish();
  publish();
  client_.send(client::request_frame(false));
  ASSERT_TRUE(until([&] { return client_.view.frames == 1; }));
  EXPECT_EQ(client_.view.hardware_number, 2u) << "the newest";
  client_.send(client::request_frame(false));
  steps(20);
  EXPECT_EQ(client_.view.frames, 1) << "never the same one twice";
  publish_to(client_, 2);
  publish();
  steps(20);
  EXPECT_EQ(client_.view.frames, 2) << "nothing without a request";
}

TEST_F(ViconServerTest, AllKindsOfClientsSeeTheSameMotion) {
  start();
  StrictClient push, pull, light, filtering;
  open_push(push);
  open(pull);
  open_push(light, client::kLight);
  open_push(filtering);
  filtering.send(client::filter({{8, {2}}, {9, {2}}}));
  steps(5);
  for (int i = 1; i <= 30; ++i) {
    pull.send(client::request_frame(false));
    steps(2);
    publish();
    for (const auto* client : clients_)
      ASSERT_TRUE(until([&] { return client->view.frames == i; }));
    EXPECT_EQ(push.view.frame_id, pull.view.frame_id);
    EXPECT_EQ(push.view.globals[2].t, pull.view.globals[2].t);
    EXPECT_FLOAT_EQ(light.view.lights[2].t[0], static_cast<float>(push.view.globals[2].t[0]));
    EXPECT_THAT(filtering.view.globals, ElementsAre(Pair(2, testing::_)));
  }
  for (const auto* client : clients_) EXPECT_THAT(client->view.violations, IsEmpty());
}

TEST_F(ViconServerTest, AFrameToManyClientsAllocatesNothing) {
  start();
  std::array<StrictClient, 5> clients;
  for (auto& client : clients)
    open_push(client, &client == &clients[0] ? client::kLight : client::kSegments);
  std::vector<std::shared_ptr<SceneFrame>> frames;
  for (int i = 0; i < 300; ++i) frames.push_back(frame());
  std::uint64_t allocated = 0;
  for (std::size_t i = 0; i < 300; ++i) {
    log::flush(std::chrono::seconds(10));  // its thread allocates, too
    const AllocationCounter allocations;
    server_->publish(frames[i]);
    io_.restart();
    io_.poll();
    if (i >= 100) allocated += allocations.count();
    for (auto& client : clients) client.pump();
  }
  EXPECT_EQ(allocated, 0u);
  EXPECT_EQ(status().at(4).frames_sent, 300u);
}

TEST_F(ViconServerTest, StatusShowsPeerModeAndContent) {
  start();
  open_push(client_, client::kLight);
  client_.send(client::filter({{901, {1}}}));
  steps(5);
  clock_.advance(std::chrono::seconds(7));
  const auto all = status();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].protocol, "vicon");
  EXPECT_THAT(all[0].peer, HasSubstr("127.0.0.1:"));
  EXPECT_EQ(all[0].detail, "z-up mm, push, lightweight segments, 1 subjects only");
  EXPECT_DOUBLE_EQ(all[0].connected_s, 7.0);
}

TEST_F(ViconServerTest, SendsTheNewestFrameAndMissedChangesToASlowClient) {
  start(numbered_names(40));
  open_push(client_);
  publish_to(client_, 1);
  client_.stop_reading();
  ASSERT_TRUE(until([&] {
    publish();
    return status()[0].frames_dropped > 50;  // the kernel's buffers have stopped growing
  }));
  auto renamed = frame();
  auto model = std::make_shared<SceneModel>(*renamed->model);
  model->generation = 2;
  model->bodies[3].name = "renamed";
  renamed->model = model;
  server_->publish(renamed);
  for (int i = 0; i < 5; ++i) {  // the frame with the new name is never sent
    auto later = frame();
    later->model = model;
    server_->publish(later);
    steps(2);
  }
  client_.resume_reading();
  const auto newest = static_cast<std::uint32_t>(number_);
  ASSERT_TRUE(until([&] { return client_.view.hardware_number == newest; }));
  EXPECT_EQ(client_.view.id_of("renamed"), 4u);
  EXPECT_THAT(client_.view.names, SizeIs(40));
}

}  // namespace
}  // namespace fiducap::vicon
