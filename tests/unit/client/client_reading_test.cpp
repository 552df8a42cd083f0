// Predictions, and reading without allocation while a server streams.
#include <gmock/gmock.h>

#include "support/allocation_counter.hpp"
#include "unit/client/test_server.hpp"

namespace fiducap {
namespace {

// Other threads may renew a lease while a test counts; a thousand readings that allocated would be
// far more.
constexpr std::uint64_t kOfARenewal = 100;

TEST_F(ClientServerTest, PredictsWithVelocityAndRate) {
  connect();
  Body body;
  ASSERT_TRUE(client_->predict("arm", std::chrono::milliseconds(200), body));
  const BodyPose& sent = scene_->bodies[1];
  constexpr double kFloat = 1e-7;  // velocity and rate are 32-bit floats on the wire
  EXPECT_NEAR(body.position_m[0], sent.X_WP.p.x() + 0.2 * 0.5, kFloat);
  EXPECT_NEAR(body.position_m[1], sent.X_WP.p.y() - 0.2 * 0.25, kFloat);
  const Eigen::Quaterniond q = sent.X_WP.q * exp_so3(0.2 * sent.w_WP_P);
  EXPECT_THAT(body.orientation_wxyz,
              testing::Pointwise(testing::DoubleNear(kFloat), {q.w(), q.x(), q.y(), q.z()}));
  EXPECT_NEAR(body.age_s, 0.22, kFloat);
  EXPECT_FALSE(client_->predict("unknown", std::chrono::milliseconds(1), body));
}

TEST_F(ClientServerTest, PredictsOnlyValidBodies) {
  scene_->bodies[1].valid = false;
  connect();
  Body body;
  EXPECT_FALSE(client_->predict("arm", std::chrono::milliseconds(1), body));
  EXPECT_TRUE(client_->predict("drone", std::chrono::milliseconds(1), body));
}

TEST_F(ClientServerTest, LatestAllocatesNothingOnceTheFrameHasRoom) {
  scene_ = make_scene_frame(numbered_names(50), 1);
  connect();
  ASSERT_TRUE(publish_until([&] { return statistics().frames >= 50; }));
  ASSERT_TRUE(client_->wait_for_frame(scene_->number - 1, kTimeout));
  ASSERT_TRUE(client_->latest(frame_));
  const AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(client_->latest(frame_));
  EXPECT_LT(allocations.count(), kOfARenewal);
  EXPECT_EQ(frame_.bodies.size(), 50u);
}

TEST_F(ClientServerTest, ReadingAndPredictingAllocateNothingWithoutAServer) {
  scene_ = make_scene_frame(numbered_names(50), 1);
  // After the end of the server the client's thread sleeps.
  connect([](ClientOptions& options) { options.reconnect_s = 60; });
  Body body;
  ASSERT_TRUE(publish_until([&] { return client_->latest(frame_) && statistics().frames > 10; }));
  ASSERT_TRUE(client_->predict("body7", std::chrono::milliseconds(20), body));
  server_.reset();
  ASSERT_TRUE(wait_until([&] { return !statistics().connected; }));
  ASSERT_TRUE(client_->latest(frame_));
  const AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) {
    (void)client_->latest(frame_);
    (void)client_->predict("body7", std::chrono::milliseconds(20), body);
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(frame_.bodies.size(), 50u);
}

TEST_F(ClientServerTest, SteadyStreamAllocatesNothingOnEitherSide) {
  boost::asio::io_context io;  // polled here: only the client's thread runs beside the test
  const FakeClock clock(instant_from_ns(1'000'000'000'000));
  scene_ = make_scene_frame(numbered_names(20), 1);
  native::NativeConfig config;
  config.port = 0;
  const auto server = value_of(native::start_native_server(io, config, scene_->model, clock));
  const Client client(options_for(server->port()));
  ASSERT_TRUE(wait_until([&] {
    io.poll();
    return client.statistics().connected;
  }));
  const auto send = [&](int count) {
    for (int i = 0; i < count; ++i) {
      ++scene_->number;
      server->publish(scene_);
      ASSERT_TRUE(client.wait_for_frame(scene_->number - 1, kTimeout));
    }
  };
  send(50);
  const AllocationCounter allocations;
  send(300);
  EXPECT_LT(allocations.count(), kOfARenewal);
}

}  // namespace
}  // namespace fiducap
