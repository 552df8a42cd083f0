#include <gmock/gmock.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "robot.hpp"
#include "support/fake_clock.hpp"
#include "support/results.hpp"

namespace fiducap::simulation {
namespace {

constexpr Instant kStart = instant_from_ns(5'000'000'000);

std::unique_ptr<SimulatedSource> make(const SimulatedBodyConfig& body, const Clock* clock = nullptr,
                                      const std::string& room = "hall") {
  return value_of(make_simulated_source(room_of(room), body, kStart, clock));
}

template <typename Sample>
std::vector<Sample> samples_of(const SimulatedBodyConfig& body, const std::string& room = "hall") {
  return only<Sample>(run_out(*make(body, nullptr, room)));
}

SimulatedBodyConfig body_of(const std::string& kind, double duration_s) {
  SimulatedBodyConfig body = corner_robot(kind);
  body.trajectory.duration_s = duration_s;
  return body;
}

SimulatedBodyConfig short_run(double duration_s = 5) { return body_of("survey", duration_s); }

bool same(const CornerFrame& a, const CornerFrame& b) {
  return a.exposed_at == b.exposed_at && a.camera == b.camera &&
         std::ranges::equal(a.tags, b.tags, [](const TagSighting& x, const TagSighting& y) {
           return x.tag_id == y.tag_id && x.corners_px == y.corners_px;
         });
}

bool same(const SensorSample& a, const SensorSample& b) {
  if (a.index() != b.index() || time_of(a) != time_of(b)) return false;
  if (const auto* imu = std::get_if<ImuSample>(&a))
    return imu->f_B == std::get<ImuSample>(b).f_B && imu->w_WB_B == std::get<ImuSample>(b).w_WB_B;
  return same(std::get<CornerFrame>(a), std::get<CornerFrame>(b));
}

bool same(const std::vector<SensorSample>& a, const std::vector<SensorSample>& b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) { return same(x, y); });
}

TEST(SimulatedSource, GivesEverySampleOnItsGrid) {
  const auto samples = run_out(*make(short_run(2)));
  const auto imu = only<ImuSample>(samples);
  ASSERT_EQ(imu.size(), 401u);  // 200 Hz, both ends
  for (std::size_t k = 0; k < imu.size(); ++k)
    EXPECT_EQ(imu[k].sampled_at, kStart + Duration{5'000'000} * static_cast<int>(k));
  const auto frames = only<CornerFrame>(samples);
  ASSERT_EQ(frames.size(), 40u);
  for (std::size_t k = 0; k < frames.size(); ++k)
    EXPECT_EQ(frames[k].exposed_at,
              kStart + Duration{1'300'000} + Duration{50'000'000} * static_cast<int>(k));
}

TEST(SimulatedSource, ComesInOrderOfArrival) {
  SimulatedBodyConfig body = short_run(2);
  body.camera.latency_s = 0.030;
  Instant newest_imu = kStart;
  for (const SensorSample& sample : run_out(*make(body))) {
    if (std::holds_alternative<ImuSample>(sample)) {
      newest_imu = time_of(sample);
    } else if (newest_imu < kStart + std::chrono::milliseconds(1960)) {
      EXPECT_EQ(newest_imu, time_of(sample) - Duration{1'300'000} + Duration{30'000'000});
    }
  }
}

TEST(SimulatedSource, IsReproducibleAtAnyPace) {
  SimulatedBodyConfig body = short_run(3);
  body.faults.jitter_s = 0.004;
  body.faults.drop_image = 0.2;
  body.faults.wrong_id = 0.1;
  body.faults.occlude = 0.1;
  const FakeClock clock(kStart);
  const auto unpaced = run_out(*make(body));
  const auto paced = run_out(*make(body, &clock));
  EXPECT_GT(unpaced.size(), 600u);
  EXPECT_TRUE(same(unpaced, paced));
  body.seed = 2;
  EXPECT_FALSE(same(unpaced, run_out(*make(body))));
}

TEST(SimulatedSource, ReleasesPacedSamplesWhenTheyAreDue) {
  const FakeClock clock(kStart - std::chrono::seconds(1));
  const auto source = make(short_run(1), &clock);
  while (const auto sample = value_of(source->next({}))) {
    const bool image = std::holds_alternative<CornerFrame>(*sample);
    EXPECT_EQ(clock.now(), time_of(*sample) + (image ? Duration{10'000'000} : Duration{0}));
  }
}

TEST(SimulatedSource, StopsWhenRequested) {
  std::stop_source stop;
  const FakeClock clock(kStart);
  const auto source = make(corner_robot("survey"), &clock);
  EXPECT_TRUE(source->next(stop.get_token())->has_value());
  stop.request_stop();
  EXPECT_FALSE(source->next(stop.get_token())->has_value());
}

TEST(SimulatedSource, HasTheTruthOfItsSamples) {
  SimulatedBodyConfig body = short_run(4);
  body.imu.noise.gyro_noise_rad_s_rtHz = 0;
  body.imu.noise.accel_noise_m_s2_rtHz = 0;
  body.camera.corner_noise_px = 0;
  const auto source = make(body);
  const auto samples = run_out(*source);
  const auto tags = tags_of(room_of("hall"));
  for (const CornerFrame& frame : only<CornerFrame>(samples)) {
    const Pose X_VW = (source->truth(frame.exposed_at).X_WB * body.cameras[0].X_BV).inverse();
    for (const TagSighting& tag : frame.tags) {
      const auto& true_tag = tags[static_cast<std::size_t>(tag.tag_id)];
      const double h = 0.5 * true_tag.edge_m;
      const auto px =
          body.cameras[0].model.project(X_VW * (true_tag.X_WT * Eigen::Vector3d(h, h, 0)));
      EXPECT_LT((*px - tag.corners_px[2]).norm(), 1e-9);
    }
  }
  const ImuSample first = only<ImuSample>(samples).front();
  const TruthSample rest = source->truth(kStart);
  EXPECT_LT((first.w_WB_B - rest.bias_w).norm(), 1e-12);
  EXPECT_LT((rest.X_WB.q * (first.f_B - rest.bias_f) - Eigen::Vector3d(0, 0, 9.81)).norm(), 1e-9);
}

TEST(SimulatedSource, HasTheSameImuWithOtherImages) {
  SimulatedBodyConfig body = short_run(2);
  const auto with = samples_of<ImuSample>(body);
  body.camera.miss_probability = 0.5;
  body.faults.drop_image = 0.5;
  const auto other = samples_of<ImuSample>(body);
  ASSERT_EQ(with.size(), other.size());
  for (std::size_t k = 0; k < with.size(); ++k) EXPECT_EQ(with[k].f_B, other[k].f_B);
}

TEST(SimulatedSource, WorksWithoutImuAndWithSeveralCameras) {
  SimulatedBodyConfig body = short_run(2);
  body.has_imu = false;
  EXPECT_EQ(run_out(*make(body)).size(), 40u);
  EXPECT_TRUE(samples_of<ImuSample>(body).empty());
  body.cameras.push_back(body.cameras[0]);
  const auto frames = samples_of<CornerFrame>(body);
  ASSERT_EQ(frames.size(), 80u);
  for (std::size_t k = 0; k < frames.size(); ++k)
    EXPECT_EQ(frames[k].camera, static_cast<int>(k % 2)) << "simultaneous images by camera";
}

TEST(SimulatedSource, DropsItsShareOfImagesAndImuSamples) {
  SimulatedBodyConfig body = short_run(60);
  body.faults.drop_image = 0.25;
  body.faults.drop_imu = 0.1;
  const auto samples = run_out(*make(body));
  EXPECT_NEAR(static_cast<double>(only<CornerFrame>(samples).size()) / 1200, 0.75,
              5 * 0.433 / 34.6);
  EXPECT_NEAR(static_cast<double>(only<ImuSample>(samples).size()) / 12001, 0.9, 5 * 0.3 / 109.5);
}

TEST(SimulatedSource, KeepsTheOrderOfASensorUnderJitter) {
  SimulatedBodyConfig body = short_run(5);
  body.faults.jitter_s = 0.05;
  body.faults.delay_image_s = 0.1;
  Instant imu = kStart - Duration{1};
  Instant image = kStart - Duration{1};
  int crossings = 0;
  for (const SensorSample& sample : run_out(*make(body))) {
    Instant& last = std::holds_alternative<ImuSample>(sample) ? imu : image;
    EXPECT_GT(time_of(sample), last);
    last = time_of(sample);
    if (std::max(imu, image) > last) ++crossings;
  }
  EXPECT_GT(crossings, 50);
}

TEST(SimulatedSource, RepeatsBlackouts) {
  SimulatedBodyConfig body = short_run(10);
  body.faults.blackout_every_s = 3;
  body.faults.blackout_s = 1;
  for (const CornerFrame& frame : samples_of<CornerFrame>(body)) {
    const double t = to_seconds(frame.exposed_at - kStart);
    EXPECT_FALSE(t >= 3 && std::fmod(t, 3.0) < 1.0) << t;
  }
}

TEST(SimulatedSource, HasWrongIdsOfTheFamilyAndOccludedTags) {
  SimulatedBodyConfig body = body_of("ceiling", 30);
  int strangers = 0;
  const auto count = [&] {
    std::size_t seen = 0;
    for (const CornerFrame& frame : samples_of<CornerFrame>(body, "ceiling")) {
      seen += frame.tags.size();
      for (const TagSighting& tag : frame.tags) {
        EXPECT_LT(tag.tag_id, 587);
        strangers += tag.tag_id >= 100 ? 1 : 0;
      }
    }
    return static_cast<double>(seen);
  };
  const double all = count();
  EXPECT_EQ(strangers, 0);
  body.faults.occlude = 0.5;
  EXPECT_NEAR(count() / all, 0.5, 0.05);
  body.faults.occlude = 0;
  body.faults.wrong_id = 0.2;
  (void)count();
  EXPECT_NEAR(strangers / all, 0.2 * 487.0 / 586.0, 0.03);
}

TEST(SensorFaults, ReportACoveredCornerInsideTheTag) {
  SimulatedBodyConfig body = body_of("ceiling", 30);
  const auto clean = samples_of<CornerFrame>(body, "ceiling");
  body.faults.occlude_corner = 0.2;
  const auto touched = samples_of<CornerFrame>(body, "ceiling");
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

TEST(SensorFaults, ChangeOnlyTheStampOfAnImage) {
  SimulatedBodyConfig body = body_of("survey", 3);
  const auto clean = samples_of<CornerFrame>(body);
  body.faults.image_stamp_error_s = 0.05;
  const auto late = samples_of<CornerFrame>(body);
  ASSERT_EQ(clean.size(), late.size());
  for (std::size_t k = 0; k < clean.size(); ++k) {
    CornerFrame expected = clean[k];
    expected.exposed_at += std::chrono::milliseconds(50);
    EXPECT_TRUE(same(late[k], expected)) << k;
  }
}

TEST(SensorFaults, KeepOrderAndReadingsUnderImuJitter) {
  SimulatedBodyConfig body = body_of("survey", 20);
  const auto clean = samples_of<ImuSample>(body);
  body.faults.imu_stamp_jitter_s = 0.001;
  const auto jittered = samples_of<ImuSample>(body);
  ASSERT_EQ(clean.size(), jittered.size());
  double square = 0;
  for (std::size_t k = 0; k < clean.size(); ++k) {
    const double error = to_seconds(jittered[k].sampled_at - clean[k].sampled_at);
    square += error * error;
    EXPECT_EQ(clean[k].f_B, jittered[k].f_B);
    EXPECT_TRUE(k == 0 || jittered[k].sampled_at > jittered[k - 1].sampled_at);
  }
  // Cut off at 2.25 ms, that is 2.25 sigma: 0.973 of the sigma remain (sampling error of 4001
  // draws: 1.1 %).
  EXPECT_NEAR(std::sqrt(square / static_cast<double>(clean.size())), 0.973e-3, 0.05e-3);
}

TEST(SensorFaults, LimitASaturatedImuForAWhile) {
  SimulatedBodyConfig body = body_of("table", 20);
  const auto clean = samples_of<ImuSample>(body, "table");
  body.faults.saturation_at_s = 8;
  body.faults.saturation_s = 3;
  body.faults.saturated_gyro_rad_s = 0.2;
  body.faults.saturated_accel_m_s2 = 9.0;
  const auto cut = samples_of<ImuSample>(body, "table");
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
