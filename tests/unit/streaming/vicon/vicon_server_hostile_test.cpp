// Clients that stall, flood, lie or send garbage: the others must not notice.
#include <gmock/gmock.h>

#include <random>

#include "server_fixture.hpp"
#include "support/hex.hpp"

namespace fiducap::vicon {
namespace {

using testing::IsEmpty;

std::vector<std::string> many_bodies() {
  std::vector<std::string> many;
  for (int i = 0; i < 40; ++i) many.push_back("body" + std::to_string(i));
  return many;
}

TEST_F(ViconServerTest, AStalledClientLosesFramesThenItsPlaceWithoutEffectOnOthers) {
  start(many_bodies());
  StrictClient stalled;
  StrictClient reading;
  open(stalled);
  open(reading);
  stalled.send(client::request_frame(true));
  reading.send(client::request_frame(true));
  steps(5);
  stalled.stop_reading();
  constexpr int kFrames =
      1500;  // 40 bodies · 250 bytes · 1500 = 15 MB, more than any socket buffer takes
  for (int i = 1; i <= kFrames; ++i) {
    publish();
    ASSERT_TRUE(until([&] { return reading.view.frames == i; }));
  }
  EXPECT_THAT(reading.view.violations, IsEmpty());
  auto all = status();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_GT(all[0].frames_dropped, 100u);
  EXPECT_EQ(all[0].frames_sent + all[0].frames_dropped, static_cast<std::uint64_t>(kFrames));
  EXPECT_EQ(all[1].frames_dropped, 0u);
  pass(std::chrono::seconds(6));
  publish();
  ASSERT_TRUE(until([&] { return reading.view.frames == kFrames + 1; }));
  EXPECT_EQ(status().size(), 1u);
}

TEST_F(ViconServerTest, AClientThatWakesUpGetsTheNewestFrameAndEverythingThatChangedMeanwhile) {
  start(many_bodies());
  StrictClient sleepy;
  open(sleepy);
  sleepy.send(client::request_frame(true));
  steps(3);
  publish();
  ASSERT_TRUE(until([&] { return sleepy.view.frames == 1; }));
  sleepy.stop_reading();
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
  sleepy.resume_reading();
  const auto newest = static_cast<std::uint32_t>(number_);
  ASSERT_TRUE(until([&] { return sleepy.view.hardware_number == newest; }));
  EXPECT_EQ(sleepy.view.id_of("renamed"), 4u);
  EXPECT_EQ(sleepy.view.names.size(), 40u);
  EXPECT_THAT(sleepy.view.violations, IsEmpty());
}

TEST_F(ViconServerTest, ClosesWhoNeverSaysWhatItWants) {
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
  StrictClient good;
  open(good);
  good.send(client::request_frame(true));
  StrictClient http;
  StrictClient four_gigabytes;
  StrictClient lying;
  for (auto* client : {&http, &four_gigabytes, &lying}) {
    client->connect(port_);
    clients_.push_back(client);
  }
  http.send(from_hex("474554202f20485454502f312e310d0a"));
  four_gigabytes.send(from_hex("01002b1a ffffffff a1860100 ffffffff ffffffff"));
  lying.send(from_hex("01002b1a 0c000000 a1860100 04000000 ffffffff"));
  ASSERT_TRUE(until([&] {
    return http.closed_by_server() && four_gigabytes.closed_by_server() && lying.closed_by_server();
  }));
  publish();
  ASSERT_TRUE(until([&] { return good.view.frames == 1; }));
  EXPECT_EQ(status().size(), 1u);
}

TEST_F(ViconServerTest, ReadsNamesAndFiltersOf64KiBAndForgetsThem) {
  start();
  StrictClient client;
  open(client);
  client.send(
      client::packet(77777, client::Bytes(65000, std::byte{'a'})));  // a name in an unknown object
  std::set<std::uint32_t> ids;
  for (std::uint32_t i = 1; i < 16000; ++i) ids.insert(i * 2);
  client.send(client::filter({{9, ids}}));
  client.send(client::request_frame(true));
  steps(20);
  publish();
  ASSERT_TRUE(until([&] { return client.view.frames == 1; }));
  EXPECT_FALSE(client.view.globals.contains(1));
  EXPECT_TRUE(client.view.globals.contains(2));
  EXPECT_THAT(client.view.violations, IsEmpty());
  client.send(client::packet(77777, client::Bytes(70000)));
  EXPECT_TRUE(until([&] { return client.closed_by_server(); }));
}

TEST_F(ViconServerTest, FloodsOfRequestsGetOneFrameEach) {
  start();
  StrictClient client;
  open(client);
  client::Bytes flood;
  for (int i = 0; i < 2000; ++i) {
    for (const auto& one : {client::request_frame(false), client::request_next(1)}) {
      flood.insert(flood.end(), one.begin(), one.end());
    }
  }
  publish();
  client.send(flood);
  steps(30);
  EXPECT_EQ(client.view.frames, 1) << "one frame exists";
  for (int i = 2; i < 10; ++i) {
    publish();
    steps(3);
    EXPECT_LE(client.view.frames, i);
  }
  EXPECT_EQ(status()[0].frames_dropped, 0u);
  EXPECT_THAT(client.view.violations, IsEmpty());
}

TEST_F(ViconServerTest, ClosesWhoFloodsWithPingsAndDoesNotReadTheAnswers) {
  start();
  StrictClient client;
  open(client);
  client.stop_reading();
  client::Bytes flood;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const auto one = client::ping(i);
    flood.insert(flood.end(), one.begin(), one.end());
  }
  for (int i = 0; i < 400 && !status().empty(); ++i) {  // 19 MB at most
    client.send(flood);
    steps(1);
  }
  pass(std::chrono::seconds(6));
  EXPECT_THAT(status(), IsEmpty());
}

TEST_F(ViconServerTest, SurvivesRandomBytes) {
  start();
  StrictClient good;
  open(good);
  good.send(client::request_frame(true));
  std::mt19937 random(11);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 60; ++i) {
    client::Bytes noise(1 + static_cast<std::size_t>(i) * 37);
    for (auto& b : noise) b = static_cast<std::byte>(byte(random));
    StrictClient raw;
    raw.connect(port_);
    raw.send(i % 2 == 0 ? client::packet(static_cast<std::uint32_t>(100001 + i % 8), noise)
                        : noise);
    steps(2);
  }
  publish();
  ASSERT_TRUE(until([&] { return good.view.frames == 1; }));
  ASSERT_TRUE(until([&] { return status().size() == 1; }));
}

TEST_F(ViconServerTest, TurnsAwayClientsAboveTheLimits) {
  config_.max_clients = 3;
  config_.max_clients_per_address = 2;
  start();
  StrictClient a;
  StrictClient b;
  StrictClient c;
  open(a);
  open(b);
  c.connect(port_);
  clients_.push_back(&c);
  ASSERT_TRUE(until([&] { return c.closed_by_server(); }));
  EXPECT_EQ(status().size(), 2u);
}

}  // namespace
}  // namespace fiducap::vicon
