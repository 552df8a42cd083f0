#include <gtest/gtest.h>

#include <algorithm>

#include "base/pose.hpp"
#include "robot.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::simulation {
namespace {

constexpr Instant kStart = instant_from_ns(5'000'000'000);

std::unique_ptr<SimulatedSource> make(const SimulatedBodyConfig& body, const Clock* clock = nullptr,
                                      const std::string& room = "hall") {
  auto source = make_simulated_source(room_of(room), body, kStart, clock);
  EXPECT_TRUE(source.has_value()) << source.error().text();
  return std::move(*source);
}

SimulatedBodyConfig short_run(double duration_s = 5) {
  SimulatedBodyConfig body = corner_robot("survey");
  body.trajectory.duration_s = duration_s;
  return body;
}

bool same(const SensorSample& a, const SensorSample& b) {
  if (a.index() != b.index() || time_of(a) != time_of(b)) return false;
  if (const auto* imu = std::get_if<ImuSample>(&a)) {
    return imu->f_B == std::get<ImuSample>(b).f_B && imu->w_WB_B == std::get<ImuSample>(b).w_WB_B;
  }
  if (const auto* frame = std::get_if<CameraFrame>(&a)) {
    const auto& other = std::get<CameraFrame>(b);
    return frame->camera == other.camera && frame->image->pixels == other.image->pixels;
  }
  const auto& frame = std::get<CornerFrame>(a);
  const auto& other = std::get<CornerFrame>(b);
  if (frame.camera != other.camera || frame.tags.size() != other.tags.size()) return false;
  for (std::size_t i = 0; i < frame.tags.size(); ++i) {
    if (frame.tags[i].tag_id != other.tags[i].tag_id ||
        frame.tags[i].corners_px != other.tags[i].corners_px)
      return false;
  }
  return true;
}

bool same(const std::vector<SensorSample>& a, const std::vector<SensorSample>& b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(),
                    [](const auto& x, const auto& y) { return same(x, y); });
}

TEST(SimulatedSource, GivesEverySampleOnItsGrid) {
  const auto samples = run_out(*make(short_run(2)));
  const auto imu = only<ImuSample>(samples);
  ASSERT_EQ(imu.size(), 401u);  // 200 Hz, both ends
  for (std::size_t k = 0; k < imu.size(); ++k)
    EXPECT_EQ(imu[k].sampled_at, kStart + Duration{5'000'000} * static_cast<int>(k));
  const auto frames = only<CornerFrame>(samples);
  ASSERT_EQ(frames.size(), 40u);
  for (std::size_t k = 0; k < frames.size(); ++k) {
    EXPECT_EQ(frames[k].exposed_at,
              kStart + Duration{1'300'000} + Duration{50'000'000} * static_cast<int>(k));
  }
}

TEST(SimulatedSource, ComesInOrderOfArrival) {
  SimulatedBodyConfig body = short_run(2);
  body.camera.latency_s = 0.030;
  Instant newest_imu = kStart;
  for (const SensorSample& sample : run_out(*make(body))) {
    if (std::holds_alternative<ImuSample>(sample)) newest_imu = time_of(sample);
    if (std::holds_alternative<CornerFrame>(sample) &&
        newest_imu < kStart + std::chrono::milliseconds(1960)) {
      EXPECT_EQ(newest_imu, time_of(sample) - Duration{1'300'000} + Duration{30'000'000});
    }
  }
}

TEST(SimulatedSource, TheSameConfigurationGivesTheSameBytesAtAnyPace) {
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

TEST(SimulatedSource, PacedSamplesComeWhenTheyAreDue) {
  SimulatedBodyConfig body = short_run(1);
  const FakeClock clock(kStart - std::chrono::seconds(1));
  const auto source = make(body, &clock);
  for (;;) {
    const auto sample = source->next({});
    if (!sample->has_value()) break;
    const bool image = std::holds_alternative<CornerFrame>(**sample);
    const Instant due = time_of(**sample) + (image ? Duration{10'000'000} : Duration{0});
    EXPECT_EQ(clock.now(), due);
  }
}

TEST(SimulatedSource, StopsWhenAsked) {
  std::stop_source stop;
  const FakeClock clock(kStart);
  const auto source = make(corner_robot("survey"), &clock);
  EXPECT_TRUE(source->next(stop.get_token())->has_value());
  stop.request_stop();
  EXPECT_FALSE(source->next(stop.get_token())->has_value());
}

TEST(SimulatedSource, TruthIsWhatTheSensorsSaw) {
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

TEST(SimulatedSource, SwitchingCamerasOffDoesNotChangeTheImu) {
  SimulatedBodyConfig body = short_run(2);
  const auto with = only<ImuSample>(run_out(*make(body)));
  body.camera.miss_probability = 0.5;
  body.faults.drop_image = 0.5;
  const auto other = only<ImuSample>(run_out(*make(body)));
  ASSERT_EQ(with.size(), other.size());
  for (std::size_t k = 0; k < with.size(); ++k) EXPECT_EQ(with[k].f_B, other[k].f_B);
}

TEST(SimulatedSource, WorksWithoutImu) {
  SimulatedBodyConfig body = short_run(2);
  body.has_imu = false;
  const auto samples = run_out(*make(body));
  EXPECT_EQ(samples.size(), 40u);
  EXPECT_TRUE(only<ImuSample>(samples).empty());
}

TEST(SimulatedSource, SeveralCamerasComeByIndex) {
  SimulatedBodyConfig body = short_run(1);
  body.cameras.push_back(body.cameras[0]);
  const auto frames = only<CornerFrame>(run_out(*make(body)));
  ASSERT_EQ(frames.size(), 40u);
  for (std::size_t k = 0; k < frames.size(); ++k)
    EXPECT_EQ(frames[k].camera, static_cast<int>(k % 2));
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

TEST(SimulatedSource, JitterDelaysButKeepsEachSensorsOrder) {
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

TEST(SimulatedSource, BlackoutsRepeat) {
  SimulatedBodyConfig body = short_run(10);
  body.faults.blackout_every_s = 3;
  body.faults.blackout_s = 1;
  for (const CornerFrame& frame : only<CornerFrame>(run_out(*make(body)))) {
    const double t = to_seconds(frame.exposed_at - kStart);
    EXPECT_FALSE(t >= 3 && std::fmod(t, 3.0) < 1.0) << t;
  }
}

TEST(SimulatedSource, WrongIdsAreOfTheFamilyAndOccludedTagsAreNotSeen) {
  SimulatedBodyConfig body = corner_robot("ceiling");
  body.trajectory.duration_s = 30;
  const auto count = [&](const SimulatedBodyConfig& config, int& strangers) {
    std::size_t seen = 0;
    for (const CornerFrame& frame : only<CornerFrame>(run_out(*make(config, nullptr, "ceiling")))) {
      seen += frame.tags.size();
      for (const TagSighting& tag : frame.tags) {
        EXPECT_LT(tag.tag_id, 587);
        strangers += tag.tag_id >= 100 ? 1 : 0;
      }
    }
    return static_cast<double>(seen);
  };
  int strangers = 0;
  const double all = count(body, strangers);
  EXPECT_EQ(strangers, 0);
  body.faults.occlude = 0.5;
  EXPECT_NEAR(count(body, strangers) / all, 0.5, 0.05);
  body.faults.occlude = 0;
  body.faults.wrong_id = 0.2;
  (void)count(body, strangers);
  EXPECT_NEAR(strangers / all, 0.2 * 487.0 / 586.0, 0.03);
}

TEST(SimulatedSource, TheMovedTagJumpsOnce) {
  SimulatedBodyConfig body = corner_robot("hover");
  body.trajectory.duration_s = 20;
  body.camera.corner_noise_px = 0;
  const auto before = only<CornerFrame>(run_out(*make(body)));
  ASSERT_FALSE(before[0].tags.empty());
  body.faults.moved_tag = before[0].tags[0].tag_id;
  body.faults.moved_at_s = 10;
  body.faults.moved_by_m = {0, 0, 0.05};
  const auto after = only<CornerFrame>(run_out(*make(body)));
  int moved = 0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    if (to_seconds(before[k].exposed_at - kStart) < 10) {
      EXPECT_TRUE(same(SensorSample(before[k]), SensorSample(after[k])));
    } else if (!same(SensorSample(before[k]), SensorSample(after[k]))) {
      ++moved;
    }
  }
  EXPECT_GT(moved, 150);
}

TEST(SimulatedSource, ABrokenConfigurationIsAnErrorThatNamesTheRule) {
  SimulatedBodyConfig body = corner_robot("survey");
  body.cameras[0].rate_hz = -1;
  const auto source = make_simulated_source(room_of("hall"), body, kStart, nullptr);
  ASSERT_FALSE(source.has_value());
  EXPECT_NE(source.error().what.find("cameras[0].rate_hz"), std::string::npos)
      << source.error().text();
}

}  // namespace
}  // namespace fiducap::simulation
