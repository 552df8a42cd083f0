// Predictions, reading without allocation while a server streams, and its time on another clock.
#include <gmock/gmock.h>

#include <cmath>

#include "support/allocation_counter.hpp"
#include "unit/client/test_server.hpp"

namespace fiducap {
namespace {

// Other threads may renew a lease while a test counts; a thousand readings that allocated would be
// far more.
constexpr std::uint64_t kOfARenewal = 100;

TEST_F(ClientServerTest, PredictsValidBodiesWithVelocityAndRate) {
  scene_->bodies[0].valid = false;
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
  for (const char* without : {"drone", "unknown"})
    EXPECT_FALSE(client_->predict(without, std::chrono::milliseconds(1), body)) << without;
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
  const auto server = value_of(native::serve({io, scene_->model, clock}, config));
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

/// The steady clock of this machine with an offset.
class DisplacedClock final : public Clock {
 public:
  explicit DisplacedClock(Duration by) : by_(by) {}
  [[nodiscard]] Instant now() const override { return instant_from_ns(monotonic_ns()) + by_; }
  [[nodiscard]] bool wait_until(Instant, std::stop_token) const override { return true; }

 private:
  Duration by_;
};

// Both ends on one loaded machine: scheduling is the only jitter.
constexpr double kLoopback_s = 2e-3;

class ClockTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(publish_until([&] { return client_.statistics().clock.known; }));
  }
  bool publish_until(const std::function<bool()>& condition) {
    return wait_until(condition, [&] {
      ++scene_->number;
      scene_->at = scene_->published_at = clock_.now();
      server_.publish(std::make_shared<SceneFrame>(*scene_));
    });
  }
  /// A frame with the time of this machine.
  bool receives_time() {
    return publish_until([&] { return client_.latest(frame_) && frame_.at_client_ns != 0; });
  }

  static constexpr Duration kOffset = std::chrono::hours(-30) + Duration{123'456'789};
  DisplacedClock clock_{kOffset};
  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone"});
  TestServer server_{*scene_, 0, {}, nullptr, &clock_};
  const Client client_{options_for(server_.port())};
  Frame frame_;
};

TEST_F(ClockTest, ClientAndServerKnowTheOffset) {
  const auto clock = client_.statistics().clock;
  EXPECT_NEAR(static_cast<double>(clock.offset_ns - kOffset.count()) * 1e-9, 0, kLoopback_s);
  EXPECT_GE(clock.sigma_s, 0);
  EXPECT_LT(clock.bound_s, kLoopback_s);
  ASSERT_TRUE(publish_until([&] { return server_.clients()[0].clock.has_value(); }))
      << server_.clients()[0].detail;
  const ClockOffset reported = *server_.clients()[0].clock;
  EXPECT_NEAR(reported.offset_s, 1e-9 * static_cast<double>(kOffset.count()), kLoopback_s);
  EXPECT_GT(reported.sigma_s, 0);
}

TEST_F(ClockTest, FramesHaveTheTimeOfThisMachine) {
  ASSERT_TRUE(receives_time());
  const auto truth = frame_.at_server_ns - kOffset.count();
  EXPECT_NEAR(static_cast<double>(frame_.at_client_ns - truth) * 1e-9, 0, kLoopback_s);
  EXPECT_FALSE(std::isnan(frame_.clock_sigma_s));
  ASSERT_TRUE(publish_until([&] { return std::isfinite(client_.statistics().latency_p99_s); }));
  EXPECT_GT(client_.statistics().latency_p50_s, -kLoopback_s);
  EXPECT_LE(client_.statistics().latency_p99_s, client_.statistics().latency_max_s);
}

TEST_F(ClockTest, PredictsToThePresent) {
  constexpr std::chrono::milliseconds kAhead{100};
  Body body;
  scene_->bodies[0].X_WP.p = {0, 0, 0};
  scene_->bodies[0].v_WP = {1, 0, 0};
  ASSERT_TRUE(receives_time());
  ASSERT_TRUE(publish_until([&] { return client_.predict_now("drone", kAhead, body); }));
  EXPECT_GE(body.position_m[0], 0.1 - kLoopback_s) << "1 m/s for 0.1 s and the age of the frame";
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_TRUE(client_.predict_now("drone", kAhead, body));
  EXPECT_GE(body.position_m[0], 0.12 - kLoopback_s) << "an old frame is predicted further";
  EXPECT_FALSE(client_.predict_now("drone", Client::kMaxPrediction, body))
      << "with its age beyond the limit";
}

}  // namespace
}  // namespace fiducap
