// Clock synchronisation through the whole client, against a server whose clock is another one.
#include <cmath>

#include "test_server.hpp"

namespace fiducap {
namespace {

/// The steady clock of this machine, displaced.
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
    client_ = std::make_unique<Client>(options_for(server_.port()));
    ASSERT_TRUE(publish([&] { return client_->statistics().clock.known; }));
  }
  template <typename Condition>
  bool publish(Condition&& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      ++scene_->number;
      scene_->at = scene_->published_at = clock_.now();
      server_.publish(std::make_shared<SceneFrame>(*scene_));
      std::this_thread::sleep_for(std::chrono::milliseconds(2));  // the pace of a 500 Hz server
    }
    return true;
  }

  static constexpr Duration kOffset = std::chrono::hours(-30) + Duration{123'456'789};
  DisplacedClock clock_{kOffset};
  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone"});
  TestServer server_{*scene_, 0, {}, nullptr, &clock_};
  std::unique_ptr<Client> client_;
};

TEST_F(ClockTest, FindsTheOffset) {
  const auto clock = client_->statistics().clock;
  EXPECT_NEAR(static_cast<double>(clock.offset_ns - kOffset.count()) * 1e-9, 0, kLoopback_s);
  EXPECT_GE(clock.sigma_s, 0);
  EXPECT_LT(clock.bound_s, kLoopback_s);
}

TEST_F(ClockTest, GivesFramesTheTimeOfThisMachine) {
  Frame frame;
  ASSERT_TRUE(publish([&] { return client_->latest(frame) && frame.at_client_ns != 0; }));
  const auto truth = frame.at_server_ns - kOffset.count();
  EXPECT_NEAR(static_cast<double>(frame.at_client_ns - truth) * 1e-9, 0, kLoopback_s);
  EXPECT_FALSE(std::isnan(frame.clock_sigma_s));
  ASSERT_TRUE(publish([&] { return std::isfinite(client_->statistics().latency_p99_s); }));
  EXPECT_GT(client_->statistics().latency_p50_s, -kLoopback_s);
  EXPECT_LE(client_->statistics().latency_p99_s, client_->statistics().latency_max_s);
}

TEST_F(ClockTest, TellsTheOperator) {
  ASSERT_TRUE(publish([&] { return server_.clients()[0].clock.has_value(); }))
      << server_.clients()[0].detail;
  const ClockOffset clock = *server_.clients()[0].clock;
  EXPECT_NEAR(clock.offset_s, 1e-9 * static_cast<double>(kOffset.count()), kLoopback_s);
  EXPECT_GT(clock.sigma_s, 0);
}

TEST_F(ClockTest, PredictsToNow) {
  Frame frame;
  Body body;
  scene_->bodies[0].X_WP.p = {0, 0, 0};
  scene_->bodies[0].v_WP = {1, 0, 0};
  ASSERT_TRUE(publish([&] { return client_->latest(frame) && frame.at_client_ns != 0; }));
  ASSERT_TRUE(
      publish([&] { return client_->predict_now("drone", std::chrono::milliseconds(100), body); }));
  EXPECT_GE(body.position_m[0], 0.1 - kLoopback_s) << "1 m/s for 0.1 s and the age of the frame";
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_TRUE(client_->latest(frame));
  Body later;
  ASSERT_TRUE(client_->predict_now("drone", std::chrono::milliseconds(100), later));
  EXPECT_GE(later.position_m[0], 0.12 - kLoopback_s) << "an old frame is carried further";
  EXPECT_FALSE(client_->predict_now("drone", Client::kMaxPrediction, later))
      << "with its age beyond the limit";
}

}  // namespace
}  // namespace fiducap
