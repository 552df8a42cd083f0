// Faults of single sensors: covered corners, wrong stamps, saturation. Each changes what it is
// about and nothing else.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "robot.hpp"

namespace fiducap::simulation {
namespace {

constexpr Instant kStart = instant_from_ns(5'000'000'000);

std::vector<SensorSample> samples_of(const SimulatedBodyConfig& body,
                                     const std::string& room = "hall") {
  auto source = make_simulated_source(room_of(room), body, kStart, nullptr);
  EXPECT_TRUE(source.has_value()) << source.error().text();
  return run_out(**source);
}

SimulatedBodyConfig body_of(const std::string& kind, double duration_s) {
  SimulatedBodyConfig body = corner_robot(kind);
  body.trajectory.duration_s = duration_s;
  return body;
}

TEST(SensorFaults, ACoveredCornerIsReportedInsideTheTag) {
  SimulatedBodyConfig body = body_of("ceiling", 30);
  const auto clean = only<CornerFrame>(samples_of(body, "ceiling"));
  body.faults.occlude_corner = 0.2;
  const auto touched = only<CornerFrame>(samples_of(body, "ceiling"));
  ASSERT_EQ(clean.size(), touched.size());
  int tags = 0;
  int covered = 0;
  for (std::size_t k = 0; k < clean.size(); ++k) {
    ASSERT_EQ(clean[k].tags.size(), touched[k].tags.size());
    for (std::size_t t = 0; t < clean[k].tags.size(); ++t) {
      const auto& before = clean[k].tags[t].corners_px;
      const auto& after = touched[k].tags[t].corners_px;
      ++tags;
      int moved = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        if (before[i] == after[i]) continue;
        ++moved;
        // Between the corner and the middle of the tag, at most an eighth along each side.
        const Eigen::Vector2d ahead = before[(i + 1) % 4] - before[i];
        const Eigen::Vector2d back = before[(i + 3) % 4] - before[i];
        Eigen::Matrix2d sides;
        sides << ahead, back;
        const Eigen::Vector2d share = sides.inverse() * (after[i] - before[i]);
        constexpr double kRounding = 1e-9;
        EXPECT_GE(share.minCoeff(), -kRounding);
        EXPECT_LE(share.maxCoeff(), 0.125 + kRounding);
      }
      EXPECT_LE(moved, 1);
      covered += moved;
    }
  }
  ASSERT_GT(tags, 2000);
  // Five sigma of a share of one in five.
  EXPECT_NEAR(static_cast<double>(covered) / tags, 0.2, 5 * 0.4 / std::sqrt(tags));
}

TEST(SensorFaults, ImagesWithAWrongStampShowTheTrueInstant) {
  SimulatedBodyConfig body = body_of("survey", 3);
  const auto clean = only<CornerFrame>(samples_of(body));
  body.faults.image_stamp_error_s = 0.05;
  const auto late = only<CornerFrame>(samples_of(body));
  ASSERT_EQ(clean.size(), late.size());
  for (std::size_t k = 0; k < clean.size(); ++k) {
    EXPECT_EQ(late[k].exposed_at - clean[k].exposed_at, std::chrono::milliseconds(50));
    ASSERT_EQ(clean[k].tags.size(), late[k].tags.size());
    for (std::size_t t = 0; t < clean[k].tags.size(); ++t)
      EXPECT_EQ(clean[k].tags[t].corners_px, late[k].tags[t].corners_px);
  }
}

TEST(SensorFaults, ImuStampsJitterButKeepTheirOrderAndReadings) {
  SimulatedBodyConfig body = body_of("survey", 20);
  const auto clean = only<ImuSample>(samples_of(body));
  body.faults.imu_stamp_jitter_s = 0.001;
  const auto jittered = only<ImuSample>(samples_of(body));
  ASSERT_EQ(clean.size(), jittered.size());
  double square = 0;
  for (std::size_t k = 0; k < clean.size(); ++k) {
    const double error = to_seconds(jittered[k].sampled_at - clean[k].sampled_at);
    square += error * error;
    EXPECT_EQ(clean[k].f_B, jittered[k].f_B);
    if (k > 0) {
      EXPECT_GT(jittered[k].sampled_at, jittered[k - 1].sampled_at);
    }
  }
  // Cut off at 2.25 ms, that is 2.25 sigma: 0.973 of the sigma remain (sampling error of 4001
  // draws: 1.1 %).
  EXPECT_NEAR(std::sqrt(square / static_cast<double>(clean.size())), 0.973e-3, 0.05e-3);
}

TEST(SensorFaults, ASaturatedImuMeasuresNoMoreThanItsRangeForAWhile) {
  SimulatedBodyConfig body = body_of("table", 20);
  const auto clean = only<ImuSample>(samples_of(body, "table"));
  body.faults.saturation_at_s = 8;
  body.faults.saturation_s = 3;
  body.faults.saturated_gyro_rad_s = 0.2;
  body.faults.saturated_accel_m_s2 = 9.0;
  const auto cut = only<ImuSample>(samples_of(body, "table"));
  ASSERT_EQ(clean.size(), cut.size());
  int gyro = 0;
  int accel = 0;
  for (std::size_t k = 0; k < clean.size(); ++k) {
    const double t_s = to_seconds(clean[k].sampled_at - kStart);
    if (t_s < 8 || t_s >= 11) {
      EXPECT_EQ(clean[k].w_WB_B, cut[k].w_WB_B);
      EXPECT_EQ(clean[k].f_B, cut[k].f_B);
      continue;
    }
    EXPECT_LE(cut[k].w_WB_B.cwiseAbs().maxCoeff(), 0.2);
    EXPECT_LE(cut[k].f_B.cwiseAbs().maxCoeff(), 9.0);
    gyro += clean[k].w_WB_B != cut[k].w_WB_B ? 1 : 0;
    accel += clean[k].f_B != cut[k].f_B ? 1 : 0;
  }
  EXPECT_GT(gyro, 100);
  EXPECT_GT(accel, 100);
}

}  // namespace
}  // namespace fiducap::simulation
