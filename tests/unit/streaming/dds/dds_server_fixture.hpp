#pragma once

#include <chrono>
#include <memory>
#include <utility>

#include <dds/dds.h>
#include <gmock/gmock.h>
#include <boost/asio/io_context.hpp>

#include "middleware/endpoints.hpp"
#include "streaming/dds/dds.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::dds {

inline constexpr int kTestDomain = 42;

/// A server of two bodies and readers of its topics, in one process.
class DdsServerTest : public testing::Test {
 protected:
  void start(const DdsConfig& config) {
    auto participant = Participant::open({.domain = kTestDomain, .peers = {}});
    ASSERT_TRUE(participant) << participant.error().text();
    participant_ = *participant;
    auto server = serve({.io = io_,
                         .model = frame_->model,
                         .clock = clock_,
                         .events = &events_,
                         .join_dds = [this] { return participant_; }},
                        config);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  void start_px4(Px4Profile profile) {
    DdsConfig config;
    config.px4 = profile;
    start(config);
  }
  std::vector<ClientStatus> clients() const {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }
  Reader read(const std::string& topic, const dds_topic_descriptor_t& type,
              const Qos& qos = {true, false, 100, 0}) {
    auto reader = Reader::make(*participant_, {topic, &type, {}}, qos);
    EXPECT_TRUE(reader) << reader.error().text();
    return std::move(*reader);
  }
  void publish(int times = 1) {
    for (int i = 0; i < times; ++i) {
      frame_ = std::make_shared<SceneFrame>(*frame_);
      ++frame_->number;
      frame_->at += std::chrono::milliseconds(10);
      server_->publish(frame_);
    }
  }

  /// A later frame of another model: the rover, with id 7.
  void only_rover_is_left() {
    frame_ = make_scene_frame({"rover"}, 500);
    auto model = std::make_shared<SceneModel>(*frame_->model);
    model->generation = 2;
    model->bodies[0].id = frame_->bodies[0].body_id = 7;
    frame_->model = model;
  }

  boost::asio::io_context io_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"big-drone", "rover"});
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
  std::shared_ptr<Participant> participant_;
  std::unique_ptr<Streamer> server_;
};

}  // namespace fiducap::dds
