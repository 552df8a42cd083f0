// The whole server on loopback, in real time: a client receives the simulated truth.
#include <gtest/gtest.h>

#include <cmath>

#include "support/running_server.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

/// Mean square of the difference of received poses and the truth at the stamped instant.
class TruthMeter final {
 public:
  TruthMeter(const ServerConfig& config, Instant start)
      : config_(config), robots_(simulated_robots(config, start)) {}

  void add(const Frame& frame) {
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      const Body& seen = frame.bodies[i];
      const Pose X_WP =
          robots_[i]->truth(instant_from_ns(frame.at_server_ns)).X_WB * config_.bodies[i].pivot;
      const Eigen::Vector3d p(seen.position_m.data());
      const auto& q = seen.orientation_wxyz;
      squares_m2_ += (p - X_WP.p).squaredNorm();
      squares_rad2_ +=
          std::pow(X_WP.q.angularDistance(Eigen::Quaterniond(q[0], q[1], q[2], q[3])), 2);
      ++count_;
    }
  }
  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] double rmse_m() const { return std::sqrt(squares_m2_ / count_); }
  [[nodiscard]] double rmse_rad() const { return std::sqrt(squares_rad2_ / count_); }

 private:
  const ServerConfig& config_;
  std::vector<std::unique_ptr<simulation::SimulatedSource>> robots_;
  double squares_m2_{0};
  double squares_rad2_{0};
  int count_{0};
};

TEST(ServedTruth, IsThatOfThreeRobots) {
  // The map is a few seconds old and the drone's camera differs by 8 mm and 0.5 degrees from the
  // configuration; three times the measured error.
  constexpr double kPosition_m = 0.15;
  constexpr double kAttitude_rad = 0.02;
  const ServerConfig config = corner_demo();
  RunningServer server(config);
  const Client client(server.client_options());
  ASSERT_TRUE(follow(client, 30s, [](const Frame& frame) { return all_tracked(frame, 3); }))
      << "not all robots were tracked within 30 s";
  TruthMeter meter(config, server->simulation_start());
  EXPECT_TRUE(follow(client, 20s,
                     [&](const Frame& frame) {
                       if (all_tracked(frame, 3)) meter.add(frame);
                       return meter.count() >= 3 * 200;
                     }))
      << "only " << meter.count() / 3 << " of 200 frames had three valid robots";
  EXPECT_LT(meter.rmse_m(), kPosition_m);
  EXPECT_LT(meter.rmse_rad(), kAttitude_rad);
  RecordProperty("rmse_mm", std::to_string(meter.rmse_m() * 1e3));
  RecordProperty("rmse_mrad", std::to_string(meter.rmse_rad() * 1e3));
}

TEST(ServedTruth, IsThatOfThreeRobotsWhileTheMapIsRefined) {
  // The room is new: the map corrects by decimetres at first.
  constexpr double kPosition_m = 0.3;
  constexpr int kFrames = 1000;
  ServerConfig config = corner_demo();
  config.map.builder.refine_period_s = 1;
  RunningServer server(config);
  const Client client(server.client_options());
  ASSERT_TRUE(follow(client, 40s, [](const Frame& frame) { return all_tracked(frame, 3); }))
      << "not all robots were tracked within 40 s";
  TruthMeter meter(config, server->simulation_start());
  int frames = 0;
  EXPECT_TRUE(follow(client, 30s, [&](const Frame& frame) {
    if (all_tracked(frame, 3)) meter.add(frame);
    return ++frames == kFrames;
  }));
  EXPECT_GT(meter.count(), 3 * kFrames * 9 / 10);
  EXPECT_LT(meter.rmse_m(), kPosition_m);
  RecordProperty("rmse_mm", std::to_string(meter.rmse_m() * 1e3));
  EXPECT_LT(server.stop(), 1s) << "also in the middle of a solution";
}

}  // namespace
}  // namespace fiducap
