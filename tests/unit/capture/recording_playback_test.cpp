// Recordings that are damaged, and the pace at which they come.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "unit/capture/recording_folder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST_F(RecordingTest, AnImageThatIsNoImageIsDroppedCountedAndSaid) {
  write_basics();
  folder_.write("mav0/cam0/data.csv",
                "1000000000000,broken.png\n1000100000000,missing.png\n1000200000000,small.png\n"
                "1000300000000,../sensor.yaml\n1000400000000,good.png\n1000500000000,empty.png\n");
  folder_.write("mav0/cam0/data/broken.png", "this is no picture");
  folder_.write("mav0/cam0/data/empty.png", "");
  write_image("small.png", 20, 30);
  write_image("good.png");
  EXPECT_THAT(stamps_ms(play()), ElementsAre(1'000'402));
  EXPECT_THAT(log_text(), HasSubstr("broken.png: is no image"));
  EXPECT_THAT(log_text(), HasSubstr("4 images left out"));
  EXPECT_THAT(log_text(), HasSubstr("1 damaged lines left out"));
}

TEST_F(RecordingTest, DamagedLinesAreLeftOutAndCounted) {
  write_corners();
  write_imu(
      "1000101000000,1,2,3,4,5,6\nrubbish\n1000102000000,1,2,3,4,5\n1000103000000,1,2,x,4,5,6\n"
      "-5,1,2,3,4,5,6\n9999999999999999999999,1,2,3,4,5,6\n" +
      std::string(200'000, '7') + "\n1000104000000,1,2,3,4,5,6\r\n");
  std::size_t imu = 0;
  for (const SensorSample& sample : play()) imu += std::holds_alternative<ImuSample>(sample);
  EXPECT_EQ(imu, 2u);
  EXPECT_THAT(log_text(),
              HasSubstr("imu0/data.csv: 6 damaged lines left out, the first is line 3"));
}

TEST_F(RecordingTest, AFileThatEndsInTheMiddleOfALineGivesAllLinesBeforeIt) {
  write_basics();
  write_corners("1000100000000,5,0,1,2,3,4,5,6,7,8\n1000200000000,5,0,1,2,3,4,5,6,7,8", "");
  EXPECT_THAT(stamps_ms(play()), ElementsAre(1'000'102)) << "the last 8 may have been 812.5";
}

TEST_F(RecordingTest, NumbersThatAreNoNumbersArePassedOnForTheMergerToCount) {
  write_basics();
  write_imu("1000101000000,nan,2,3,4,5,6\n");
  const auto samples = play();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_FALSE(std::get<ImuSample>(samples[0]).w_WB_B.allFinite());
}

TEST_F(RecordingTest, ALineBeforeItsTimeIsLeftOutAndTheRestStillComes) {
  write_basics();
  write_imu("1000101000000,1,2,3,4,5,6\n1000050000000,1,2,3,4,5,6\n1000102000000,1,2,3,4,5,6\n");
  EXPECT_THAT(stamps_ms(play()), ElementsAre(1'000'101, 1'000'102));
  EXPECT_THAT(log_text(), HasSubstr("imu0/data.csv: stamps of 1 of 3 lines are out of order or far "
                                    "from the others: left out (first in line 3)"));
}

TEST_F(RecordingTest, AFirstStampFarInTheFutureCostsItsOwnLineOnly) {
  write_basics();
  write_imu(
      "3900000000000000000,1,2,3,4,5,6\n1000101000000,1,2,3,4,5,6\n1000102000000,1,2,3,4,5,6\n");
  EXPECT_THAT(stamps_ms(play()), ElementsAre(1'000'101, 1'000'102));
  EXPECT_THAT(log_text(), HasSubstr("stamps of 1 of 3 lines"));
  EXPECT_THAT(log_text(), HasSubstr("first in line 2"));
}

TEST_F(RecordingTest, AWrongStampOfACornerCostsItsOwnLineOnly) {
  write_corners(
      "1000000000000,5,0,1,2,3,4,5,6,7,8\n1000100000000,5,0,1,2,3,4,5,6,7,8\n"
      "5,5,0,1,2,3,4,5,6,7,8\n1000300000000,5,0,1,2,3,4,5,6,7,8\n");
  std::vector<std::size_t> tags;
  for (const SensorSample& sample : play())
    tags.push_back(std::get<CornerFrame>(sample).tags.size());
  EXPECT_THAT(tags, ElementsAre(1, 1, 0, 1));
}

TEST_F(RecordingTest, AStampFarInTheFutureIsDamageAndDoesNotHangThePlayback) {
  write_basics();
  write_imu(
      "1000101000000,1,2,3,4,5,6\n3999999999999999999,1,2,3,4,5,6\n1000102000000,1,2,3,4,5,6\n");
  EXPECT_THAT(stamps_ms(play()), ElementsAre(1'000'101, 1'000'102));
}

TEST_F(RecordingTest, PacedPlaybackMovesTheStampsToTheClockAndWaitsForThem) {
  write_corners();
  const auto source = open({.paced = true});
  for (const int expected_ms : {5000, 5100, 5200, 5300}) {
    const auto sample = source->next({}).value().value();
    EXPECT_EQ(time_of(sample), instant_from_ns(expected_ms * 1'000'000LL));
    EXPECT_EQ(clock_.now(), time_of(sample));
  }
  EXPECT_FALSE(source->next({}).value());
}

TEST_F(RecordingTest, PacedPlaybackAtDoubleSpeedTakesHalfTheTime) {
  write_corners();
  const auto samples = play({.paced = true, .speed = 2.0});
  EXPECT_THAT(stamps_ms(samples), ElementsAre(5000, 5050, 5100, 5150));
}

TEST_F(RecordingTest, ASpeedThatWouldFalsifyTheImuIsRefused) {
  write_corners();
  write_imu("1000101000000,1,2,3,4,5,6\n");
  const auto info = read_recording_info(folder_.text()).value();
  const auto refused = open_recording(info, {.paced = true, .speed = 2.0}, clock_);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), HasSubstr("speed must be 1"));
  EXPECT_FALSE(open_recording(info, {.paced = true, .speed = 0}, clock_));
}

TEST_F(RecordingTest, ALoopGoesOnWithStrictlyIncreasingStamps) {
  write_corners();
  // 10 Hz camera: the next pass begins 100 ms after the last frame.
  EXPECT_THAT(stamps_ms(play({.loop = true}, 9)),
              ElementsAre(1'000'002, 1'000'102, 1'000'202, 1'000'302, 1'000'402, 1'000'502,
                          1'000'602, 1'000'702, 1'000'802));
  EXPECT_THAT(stamps_ms(play({.paced = true, .loop = true}, 6)),
              ElementsAre(5000, 5100, 5200, 5300, 5400, 5500));
}

TEST_F(RecordingTest, ALoopOverARecordingWithoutAnySampleEnds) {
  write_corners("", "");
  EXPECT_TRUE(play({.loop = true}).empty());
}

TEST_F(RecordingTest, AStopEndsThePlayback) {
  write_corners();
  std::stop_source stop;
  const auto source = open({.paced = true});
  ASSERT_TRUE(source->next(stop.get_token()).value());
  stop.request_stop();
  EXPECT_FALSE(source->next(stop.get_token()).value());
}

}  // namespace
}  // namespace fiducap
