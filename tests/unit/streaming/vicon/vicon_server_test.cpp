#include "streaming/vicon/vicon.hpp"

#include <gmock/gmock.h>

#include "base/log.hpp"
#include "server_fixture.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::vicon {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;
using testing::SizeIs;

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

TEST_F(ViconServerTest, PrefetchGetsTheNextNFrames) {
  start();
  open(client_);
  client_.send(client::request_next(3));
  steps(3);
  for (int i = 0; i < 6; ++i) {
    publish();
    steps(3);
  }
  EXPECT_EQ(client_.view.frames, 3);
  EXPECT_EQ(client_.view.hardware_number, 3u);
}

TEST_F(ViconServerTest, AnswersARequestBeforeTheTypesOnceTheyAreKnown) {
  start();
  StrictClient client;
  client.connect(port_);
  clients_ = {&client};
  client.send(client::request_frame(false));  // as SDK 1.11 does
  publish();
  ASSERT_TRUE(until([&] { return client.view.greeted; }));
  steps(10);
  EXPECT_EQ(client.view.frames, 0);
  client.want(client::kSegments);
  ASSERT_TRUE(until([&] { return client.view.frames == 1; }));
  EXPECT_THAT(client.view.globals, SizeIs(2));
  EXPECT_THAT(client.view.violations, IsEmpty());
}

TEST_F(ViconServerTest, ModesCanBeChangedWhileRunning) {
  start();
  open_push(client_);
  publish_to(client_, 1);
  client_.send(client::request_frame(false));  // stop pushing or pull: the same request
  steps(3);
  publish();
  publish_to(client_, 2);
  client_.send(client::request_next(1));
  steps(3);
  publish_to(client_, 3);
  publish();
  steps(10);
  EXPECT_EQ(client_.view.frames, 3);
  EXPECT_THAT(status().at(0).detail, HasSubstr("prefetch"));
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

TEST_F(ViconServerTest, SendsAddedRemovedAndRenamedSubjects) {
  start();
  open_push(client_);
  publish_to(client_, 1);
  const auto publish_model = [&](std::uint64_t generation, std::vector<BodyDescription> bodies) {
    auto later = make_scene_frame(std::vector<std::string>(bodies.size(), "x"), ++number_);
    for (std::size_t i = 0; i < bodies.size(); ++i) later->bodies[i].body_id = bodies[i].id;
    later->model = std::make_shared<SceneModel>(SceneModel{generation, std::move(bodies)});
    publish_to(client_, client_.view.frames + 1, later);
  };
  publish_model(2, {{1, "arm"}, {2, "drone"}, {5, "rover"}});
  EXPECT_EQ(client_.view.id_of("rover"), 5u);
  EXPECT_TRUE(client_.view.globals.contains(5));
  publish_model(3, {{1, "left_arm"}, {5, "rover"}});
  EXPECT_THAT(client_.view.names, ElementsAre(Pair(1, "left_arm"), Pair(5, "rover")));
  EXPECT_FALSE(client_.view.globals.contains(2));
}

TEST_F(ViconServerTest, OccludesALostBodyUntilItIsTrackedAgain) {
  start();
  open_push(client_);
  auto lost = frame();
  lost->bodies[0].valid = false;
  publish_to(client_, 1, lost);
  EXPECT_THAT(client_.view.names, SizeIs(2));
  EXPECT_FALSE(client_.view.globals.contains(1));
  publish_to(client_, 2);
  EXPECT_TRUE(client_.view.globals.contains(1));
}

TEST_F(ViconServerTest, AnswersPings) {
  start();
  open(client_);
  for (std::uint32_t id = 1; id <= 30; ++id) client_.send(client::ping(id));
  ASSERT_TRUE(until([&] { return client_.view.pongs.size() == 30; }));
  EXPECT_EQ(client_.view.pongs.back(), 30u);
}

TEST_F(ViconServerTest, ChangesTypesWithTheNextFrame) {
  start();
  open_push(client_, {1, 2, 5, 26, 37, 100004});
  publish_to(client_, 1);
  EXPECT_THAT(client_.view.globals, IsEmpty());
  client_.want(client::kSegments);
  steps(3);
  publish_to(client_, 2);
  EXPECT_THAT(client_.view.globals, SizeIs(2));
  EXPECT_THAT(client_.view.topologies, SizeIs(2));
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

TEST_F(ViconServerTest, RestartsOnTheSamePortAtOnce) {
  start();
  StrictClient first;
  open(first);
  server_->stop();
  server_.reset();
  ASSERT_TRUE(until([&] { return first.closed_by_server(); }));
  start();  // port_ is that of the first run
  StrictClient second;
  open(second);
  EXPECT_TRUE(second.view.greeted);
}

TEST_F(ViconServerTest, ReportsPortAndRemedyWhenThePortIsInUse) {
  start();
  config_.port = port_;
  const auto second = start_vicon_server(io_, config_, clock_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text(), HasSubstr("port " + std::to_string(port_) + " is in use"));
  EXPECT_THAT(second.error().text(), HasSubstr("streaming.vicon.port"));
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

}  // namespace
}  // namespace fiducap::vicon
