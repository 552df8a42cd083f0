// Clients that stall, flood or send garbage must not affect the others.
#include <gmock/gmock.h>

#include <random>

#include "server_fixture.hpp"
#include "support/hex.hpp"

namespace fiducap::vicon {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

TEST_F(ViconServerTest, DropsFramesOnlyOfAStalledClientAndThenClosesIt) {
  start(numbered_names(40));
  StrictClient stalled, reading;
  open_push(stalled);
  open_push(reading);
  stalled.stop_reading();
  // 40 bodies · 250 bytes · 1500 = 15 MB, more than any socket buffer takes.
  constexpr int kFrames = 1500;
  for (int i = 1; i <= kFrames; ++i) publish_to(reading, i);
  EXPECT_THAT(reading.view.violations, IsEmpty());
  auto all = status();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_GT(all[0].frames_dropped, 100u);
  EXPECT_EQ(all[0].frames_sent + all[0].frames_dropped, static_cast<std::uint64_t>(kFrames));
  EXPECT_EQ(all[1].frames_dropped, 0u);
  pass(std::chrono::seconds(6));
  publish_to(reading, kFrames + 1);
  EXPECT_THAT(status(), SizeIs(1));
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

TEST_F(ViconServerTest, ClosesAClientThatNeverRequestsTypes) {
  start();
  StrictClient silent;
  silent.connect(port_);
  clients_ = {&silent};
  steps(60);
  pass(std::chrono::seconds(11));
  EXPECT_TRUE(until([&] { return silent.closed_by_server(); }));
  EXPECT_THAT(status(), IsEmpty());
}

TEST_F(ViconServerTest, ClosesOnlyTheClientsThatSendGarbage) {
  start();
  open_push(client_);
  const std::string kGarbage[] = {"474554202f20485454502f312e310d0a",  // GET / HTTP/1.1
                                  "01002b1a ffffffff a1860100 ffffffff ffffffff",
                                  "01002b1a 0c000000 a1860100 04000000 ffffffff"};
  std::array<StrictClient, 3> bad;
  for (auto& client : bad) {
    client.connect(port_);
    clients_.push_back(&client);
  }
  for (std::size_t i = 0; i < bad.size(); ++i) bad[i].send(from_hex(kGarbage[i]));
  for (const auto& client : bad) ASSERT_TRUE(until([&] { return client.closed_by_server(); }));
  publish_to(client_, 1);
  EXPECT_THAT(status(), SizeIs(1));
}

TEST_F(ViconServerTest, ReadsAndForgetsNamesAndFiltersOf64KiB) {
  start();
  open(client_);
  client_.send(
      client::packet(77777, client::Bytes(65000, std::byte{'a'})));  // a name in an unknown object
  std::set<std::uint32_t> ids;
  for (std::uint32_t i = 1; i < 16000; ++i) ids.insert(i * 2);
  client_.send(client::filter({{9, ids}}));
  client_.send(client::request_frame(true));
  steps(20);
  publish_to(client_, 1);
  EXPECT_FALSE(client_.view.globals.contains(1));
  EXPECT_TRUE(client_.view.globals.contains(2));
  client_.send(client::packet(77777, client::Bytes(70000)));
  EXPECT_TRUE(until([&] { return client_.closed_by_server(); }));
}

TEST_F(ViconServerTest, SendsOneFrameForAFloodOfRequests) {
  start();
  open(client_);
  client::Bytes flood;
  for (int i = 0; i < 2000; ++i) {
    for (const auto& one : {client::request_frame(false), client::request_next(1)})
      flood.insert(flood.end(), one.begin(), one.end());
  }
  publish();
  client_.send(flood);
  steps(30);
  EXPECT_EQ(client_.view.frames, 1) << "one frame exists";
  for (int i = 2; i < 10; ++i) {
    publish();
    steps(3);
    EXPECT_LE(client_.view.frames, i);
  }
  EXPECT_EQ(status()[0].frames_dropped, 0u);
}

TEST_F(ViconServerTest, ClosesAClientThatFloodsWithPingsAndDoesNotRead) {
  start();
  open(client_);
  client_.stop_reading();
  client::Bytes flood;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const auto one = client::ping(i);
    flood.insert(flood.end(), one.begin(), one.end());
  }
  for (int i = 0; i < 400 && !status().empty(); ++i) {  // 19 MB at most
    client_.send(flood);
    steps(1);
  }
  pass(std::chrono::seconds(6));
  EXPECT_THAT(status(), IsEmpty());
}

TEST_F(ViconServerTest, SurvivesRandomBytes) {
  start();
  open_push(client_);
  std::mt19937 random(11);
  std::uniform_int_distribution<int> byte(0, 255);
  for (std::uint32_t i = 0; i < 60; ++i) {
    client::Bytes noise(1 + i * 37);
    for (auto& b : noise) b = static_cast<std::byte>(byte(random));
    StrictClient raw;
    raw.connect(port_);
    raw.send(i % 2 == 0 ? client::packet(100001 + i % 8, noise) : noise);
    steps(2);
  }
  publish_to(client_, 1);
  ASSERT_TRUE(until([&] { return status().size() == 1; }));
}

TEST_F(ViconServerTest, ClosesClientsAboveTheLimits) {
  config_.max_clients = 3;
  config_.max_clients_per_address = 2;
  start();
  StrictClient a, b, c;
  open(a);
  open(b);
  c.connect(port_);
  clients_.push_back(&c);
  ASSERT_TRUE(until([&] { return c.closed_by_server(); }));
  EXPECT_THAT(status(), SizeIs(2));
}

}  // namespace
}  // namespace fiducap::vicon
