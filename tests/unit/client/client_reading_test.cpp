// What a reader gets from the client library while a server streams: predictions, and no
// allocation.
#include <gtest/gtest.h>
#include <fiducap/client.hpp>

#include <atomic>
#include <cmath>
#include <functional>
#include <thread>

#include "base/pose.hpp"
#include "support/allocation_counter.hpp"
#include "unit/client/test_server.hpp"

namespace fiducap {
namespace {

TEST_F(ClientServerTest, PredictsWithVelocityAndRate) {
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  Body body;
  ASSERT_TRUE(client.predict("arm", std::chrono::milliseconds(200), body));
  const BodyPose& sent = scene_->bodies[1];
  constexpr double kFloat = 1e-7;  // velocity and rate travel as 32-bit floats
  EXPECT_NEAR(body.position_m[0], sent.X_WP.p.x() + 0.2 * 0.5, kFloat);
  EXPECT_NEAR(body.position_m[1], sent.X_WP.p.y() - 0.2 * 0.25, kFloat);
  const Eigen::Quaterniond expected = sent.X_WP.q * exp_so3(0.2 * sent.w_WP_P);
  EXPECT_NEAR(body.orientation_wxyz[0], expected.w(), kFloat);
  EXPECT_NEAR(body.orientation_wxyz[1], expected.x(), kFloat);
  EXPECT_NEAR(body.orientation_wxyz[2], expected.y(), kFloat);
  EXPECT_NEAR(body.orientation_wxyz[3], expected.z(), kFloat);
  EXPECT_NEAR(body.age_s, 0.22, kFloat);
  EXPECT_FALSE(client.predict("nobody", std::chrono::milliseconds(1), body));
}

TEST_F(ClientServerTest, DoesNotPredictABodyThatIsNotValid) {
  scene_->bodies[1].valid = false;
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(receives_frame(client, server, frame));
  Body body;
  EXPECT_FALSE(client.predict("arm", std::chrono::milliseconds(1), body));
  EXPECT_TRUE(client.predict("drone", std::chrono::milliseconds(1), body));
}

TEST_F(ClientServerTest, LatestAllocatesNothingOnceTheFrameHasRoom) {
  scene_ = make_scene_frame(names(50), 1);
  TestServer server(*scene_);
  const Client client(options_for(server.port()));
  Frame frame;
  ASSERT_TRUE(publish_until(server, *scene_, [&] { return client.statistics().frames >= 50; }));
  ASSERT_TRUE(client.wait_for_frame(scene_->number - 1, kPatience));
  ASSERT_TRUE(client.latest(frame));
  // Other threads may renew a lease meanwhile; a thousand readings that allocated would show more
  // than that.
  constexpr std::uint64_t kOfARenewal = 100;
  const AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(client.latest(frame));
  EXPECT_LT(allocations.count(), kOfARenewal);
  EXPECT_EQ(frame.bodies.size(), 50u);
}

TEST_F(ClientServerTest, ReadingAndPredictingAllocateNotOnceWhileNobodyElseDoes) {
  scene_ = make_scene_frame(names(50), 1);
  auto server = std::make_unique<TestServer>(*scene_);
  auto options = options_for(server->port());
  options.reconnect_s = 60;  // when the server has said good-bye the client's thread sleeps
  const Client client(options);
  Frame frame;
  Body body;
  ASSERT_TRUE(publish_until(
      *server, *scene_, [&] { return client.latest(frame) && client.statistics().frames > 10; }));
  ASSERT_TRUE(client.predict("body7", std::chrono::milliseconds(20), body));
  server.reset();
  ASSERT_TRUE(wait_until([&] { return !client.statistics().connected; }));
  ASSERT_TRUE(client.latest(frame));
  const AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) {
    (void)client.latest(frame);
    (void)client.predict("body7", std::chrono::milliseconds(20), body);
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(frame.bodies.size(), 50u);
}

TEST_F(ClientServerTest, ASteadyStreamAllocatesNothingOnEitherSide) {
  boost::asio::io_context io;  // polled here: nothing but the client's thread runs beside the test
  const FakeClock clock(instant_from_ns(1'000'000'000'000));
  scene_ = make_scene_frame(names(20), 1);
  native::NativeConfig config;
  config.port = 0;
  const auto server = native::start_native_server(io, config, scene_->model, clock);
  ASSERT_TRUE(server) << server.error().text();
  const Client client(options_for((*server)->port()));
  ASSERT_TRUE(wait_until([&] {
    io.poll();
    return client.statistics().connected;
  }));
  const std::shared_ptr<SceneFrame> scene = scene_;
  const auto send = [&](int count) {
    for (int i = 0; i < count; ++i) {
      ++scene->number;
      (*server)->publish(scene);
      ASSERT_TRUE(client.wait_for_frame(scene->number - 1, kPatience));
    }
  };
  send(50);
  // The renewal once a second is a new message each time; 300 frames that allocated would show far
  // more.
  constexpr std::uint64_t kOfARenewal = 100;
  const AllocationCounter allocations;
  send(300);
  EXPECT_LT(allocations.count(), kOfARenewal);
}

}  // namespace
}  // namespace fiducap
