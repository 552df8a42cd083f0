#include "daemon/session_recorder.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

Instant at_ms(int ms) { return instant_from_ns(1'000'000'000) + std::chrono::milliseconds(ms); }

class SessionRecorderTest : public testing::Test {
 protected:
  SessionRecorderTest() {
    RecordingInfo info;
    CameraMount camera;
    camera.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    info.cameras = {camera};
    info.imu = ImuNoise{};
    recorder_.add_body("drone", info);
  }

  void take(int ms) {
    recorder_.take(0, ImuSample{at_ms(ms), {0.1, 0.2, 0.3}, {0, 0, 9.81}});
    CornerFrame corners;
    corners.exposed_at = at_ms(ms);
    TagSighting tag;
    tag.tag_id = 5;
    tag.corners_px = {Eigen::Vector2d{10, 10}, {20, 10}, {20, 20}, {10, 20}};
    corners.tags = {tag};
    recorder_.take(0, corners);
  }
  [[nodiscard]] std::string folder_of(const std::string& name) const {
    return folder_.file("recordings/" + name + "/drone");
  }

  TemporaryFolder folder_;
  SessionRecorder recorder_{RecorderConfig{folder_.file("recordings"), false}};
};

TEST_F(SessionRecorderTest, WhatIsRecordedCanBeReplayed) {
  take(0);  // before the start: not wanted
  ASSERT_TRUE(recorder_.start("first"));
  for (int ms = 10; ms <= 50; ms += 10) take(ms);
  ASSERT_TRUE(recorder_.stop());
  take(60);
  std::jthread writer([this](std::stop_token stop) { recorder_.run(stop); });
  writer.request_stop();
  writer.join();

  const auto info = read_recording_info(folder_of("first"));
  ASSERT_TRUE(info) << info.error().text();
  const FakeClock clock;
  auto source = open_recording(*info, {}, clock);
  ASSERT_TRUE(source) << source.error().text();
  int imu = 0;
  int corners = 0;
  for (auto sample = (*source)->next({}); sample && *sample; sample = (*source)->next({})) {
    if (const auto* reading = std::get_if<ImuSample>(&**sample)) {
      ++imu;
      EXPECT_NEAR(reading->f_B.z(), 9.81, 1e-9);
    } else {
      ++corners;
      EXPECT_EQ(std::get<CornerFrame>(**sample).tags.at(0).tag_id, 5);
    }
  }
  EXPECT_EQ(imu, 5);
  EXPECT_EQ(corners, 5);
}

TEST_F(SessionRecorderTest, NeverOverwritesAndTakesPlainNamesOnly) {
  ASSERT_TRUE(recorder_.start("one"));
  EXPECT_FALSE(recorder_.start("two")) << "one at a time";
  ASSERT_TRUE(recorder_.stop());
  EXPECT_FALSE(recorder_.stop());
  EXPECT_FALSE(recorder_.start("one"));
  for (const char* bad : {"", "../up", "a/b", ".hidden", "a\nb"})
    EXPECT_FALSE(recorder_.start(bad)) << bad;
}

TEST_F(SessionRecorderTest, AServerThatEndsClosesTheRecordingWhole) {
  ASSERT_TRUE(recorder_.start("last"));
  take(10);
  std::jthread writer([this](std::stop_token stop) { recorder_.run(stop); });
  writer.request_stop();
  writer.join();
  EXPECT_FALSE(recorder_.current());
  EXPECT_TRUE(read_recording_info(folder_of("last")));
}

TEST_F(SessionRecorderTest, ASlowDiskCostsSamplesNotMemory) {
  ASSERT_TRUE(recorder_.start("slow"));  // nobody writes
  for (std::size_t i = 0; i < SessionRecorder::kMaxWaiting + 100; ++i)
    take(static_cast<int>(i) + 1);
  ASSERT_TRUE(recorder_.stop());
  std::jthread writer([this](std::stop_token stop) { recorder_.run(stop); });
  writer.request_stop();
  writer.join();
  const auto info = read_recording_info(folder_of("slow"));
  EXPECT_TRUE(info);
}

}  // namespace
}  // namespace fiducap
