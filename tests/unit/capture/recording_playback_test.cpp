// Recordings that are damaged, and the pace at which they come.
#include <gmock/gmock.h>

#include "capture/recording/csv_reader.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/capture/recording_folder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST_F(RecordingTest, DropsCountsAndReportsInvalidImages) {
  write_basics();
  folder_.write("mav0/cam0/data.csv",
                "1000000000000,broken.png\n1000100000000,missing.png\n1000200000000,small.png\n"
                "1000300000000,../sensor.yaml\n1000400000000,good.png\n1000500000000,empty.png\n");
  folder_.write("mav0/cam0/data/broken.png", "this is no picture");
  folder_.write("mav0/cam0/data/empty.png", "");
  write_image("small.png", 20, 30);
  write_image("good.png");
  EXPECT_THAT(played_ms(), ElementsAre(1'000'402));
  for (const char* text :
       {"broken.png: is no image", "4 images left out", "1 damaged lines left out"})
    EXPECT_THAT(log_.text(), HasSubstr(text));
}

TEST_F(CornerRecordingTest, DropsAndCountsDamagedLines) {
  write_imu(
      "1000101000000,1,2,3,4,5,6\nrubbish\n1000102000000,1,2,3,4,5\n1000103000000,1,2,x,4,5,6\n"
      "-5,1,2,3,4,5,6\n9999999999999999999999,1,2,3,4,5,6\n" +
      std::string(200'000, '7') + "\n1000104000000,1,2,3,4,5,6\r\n");
  std::size_t imu = 0;
  for (const SensorSample& sample : play()) imu += std::holds_alternative<ImuSample>(sample);
  EXPECT_EQ(imu, 2u);
  EXPECT_THAT(log_.text(),
              HasSubstr("imu0/data.csv: 6 damaged lines left out, the first is line 3"));
}

TEST_F(RecordingTest, DropsALastLineWithoutItsEnd) {
  write_corners("1000100000000,5,0,1,2,3,4,5,6,7,8\n1000200000000,5,0,1,2,3,4,5,6,7,8", "");
  EXPECT_THAT(played_ms(), ElementsAre(1'000'102)) << "the last 8 may have been 812.5";
}

TEST_F(RecordingTest, PassesInvalidNumbersToTheMerger) {
  write_basics();
  write_imu("1000101000000,nan,2,3,4,5,6\n");
  const auto samples = play();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_FALSE(std::get<ImuSample>(samples[0]).w_WB_B.allFinite());
}

TEST_F(RecordingTest, DropsLinesOutOfOrderAndFarInTheFuture) {
  const struct {
    const char *first, *second, *logged;
  } kCases[] = {{"1000101000000", "1000050000000",
                 "imu0/data.csv: stamps of 1 of 3 lines are out of order or far from the others: "
                 "left out (first in line 3)"},
                {"3900000000000000000", "1000101000000",
                 "stamps of 1 of 3 lines are out of order or far from the others: left out (first "
                 "in line 2)"},
                {"1000101000000", "3999999999999999999", ""}};
  write_basics();
  for (const auto& [first, second, logged] : kCases) {
    const std::string values = ",1,2,3,4,5,6\n";
    write_imu(first + values + second + values + "1000102000000" + values);
    const NewLog log;
    EXPECT_THAT(played_ms(), ElementsAre(1'000'101, 1'000'102)) << second;
    EXPECT_THAT(log.text(), HasSubstr(logged));
  }
}

TEST_F(CornerRecordingTest, PlaysOnTheClockWhenPaced) {
  const auto source = open({.paced = true});
  for (const int expected_ms : {5000, 5100, 5200, 5300}) {
    const auto sample = source->next({}).value().value();
    EXPECT_EQ(time_of(sample), instant_from_ns(expected_ms * 1'000'000LL));
    EXPECT_EQ(clock_.now(), time_of(sample));
  }
  EXPECT_FALSE(source->next({}).value());
}

TEST_F(CornerRecordingTest, PlaysFasterOnlyWithoutImu) {
  EXPECT_THAT(played_ms({.paced = true, .speed = 2.0}), ElementsAre(5000, 5050, 5100, 5150));
  write_imu("1000101000000,1,2,3,4,5,6\n");
  EXPECT_THAT(error_of(open_recording(info(), {.paced = true, .speed = 2.0}, clock_)),
              HasSubstr("speed must be 1"));
  EXPECT_FALSE(open_recording(info(), {.paced = true, .speed = 0}, clock_));
}

TEST_F(CornerRecordingTest, LoopsWithIncreasingStamps) {
  // 10 Hz camera: the next pass begins 100 ms after the last frame.
  EXPECT_THAT(played_ms({.loop = true}, 9),
              ElementsAre(1'000'002, 1'000'102, 1'000'202, 1'000'302, 1'000'402, 1'000'502,
                          1'000'602, 1'000'702, 1'000'802));
  EXPECT_THAT(played_ms({.paced = true, .loop = true}, 6),
              ElementsAre(5000, 5100, 5200, 5300, 5400, 5500));
}

TEST_F(RecordingTest, EndsALoopWithoutAnySample) {
  write_corners("", "");
  EXPECT_TRUE(play({.loop = true}).empty());
}

TEST_F(CornerRecordingTest, StopsWhenRequested) {
  std::stop_source stop;
  const auto source = open({.paced = true});
  ASSERT_TRUE(source->next(stop.get_token()).value());
  stop.request_stop();
  EXPECT_FALSE(source->next(stop.get_token()).value());
}

constexpr std::int64_t kDay_ms = 86'400'000;

class StampColumnTest : public testing::Test {
 protected:
  /// Milliseconds, a line each. @return the lines that are not accepted
  std::vector<std::uint64_t> left_out(const std::vector<std::int64_t>& stamps_ms) {
    std::string text;
    for (const std::int64_t ms : stamps_ms) text += std::to_string(ms * 1'000'000) + ",x\n";
    auto column = value_of(StampColumn::read(folder_.write("data.csv", text)));
    std::vector<std::uint64_t> lines;
    for (std::uint64_t line = 1; line <= stamps_ms.size(); ++line)
      if (!column.accepts(line)) lines.push_back(line);
    EXPECT_EQ(column.left_out(), lines.size());
    first_ms_ = to_ns(column.first()) / 1'000'000;
    last_ms_ = to_ns(column.last()) / 1'000'000;
    step_ = column.step();
    return lines;
  }

  TemporaryFolder folder_;
  std::int64_t first_ms_{};
  std::int64_t last_ms_{};
  Duration step_{};
};

TEST_F(StampColumnTest, KeepsEqualStampsAndPauses) {
  EXPECT_THAT(left_out({1000, 1000, 1050, 1100, 1100, 1150, 700'000, 700'050}), testing::IsEmpty());
  EXPECT_EQ(step_, std::chrono::milliseconds(50));
  EXPECT_EQ(first_ms_, 1000);
  EXPECT_EQ(last_ms_, 700'050);
}

TEST_F(StampColumnTest, DropsOneWrongStampAnywhere) {
  for (const std::int64_t wrong : {std::int64_t{0}, std::int64_t{5}, 40 * kDay_ms}) {
    for (std::size_t at = 0; at < 6; ++at) {
      std::vector<std::int64_t> stamps;
      for (std::int64_t i = 0; i < 6; ++i) stamps.push_back(20 * kDay_ms + 50 * i);
      stamps[at] = wrong;
      EXPECT_THAT(left_out(stamps), ElementsAre(at + 1)) << wrong;
      EXPECT_GE(first_ms_, 20 * kDay_ms);
      EXPECT_LE(last_ms_, 20 * kDay_ms + 250);
    }
  }
}

TEST_F(StampColumnTest, KeepsTheLargestConsistentPart) {
  EXPECT_THAT(left_out({100, 150, 10, 60, 110, 160, 210}), ElementsAre(1, 2));
  EXPECT_THAT(left_out({100, 150, 200, 250, 10, 60}), ElementsAre(5, 6));
  EXPECT_THAT(left_out({1, 2, kDay_ms, kDay_ms + 1, kDay_ms + 2, 2 * kDay_ms}),
              ElementsAre(1, 2, 6));
  EXPECT_THAT(left_out({1, 2, 4, 3, 5}), ElementsAre(4)) << "a late line";
}

TEST_F(StampColumnTest, IsQuickForManyDescendingLines) {
  std::vector<std::int64_t> stamps;
  for (std::int64_t i = 300'000; i > 0; --i) stamps.push_back(i);
  EXPECT_EQ(left_out(stamps).size(), stamps.size() - 1);
}

}  // namespace
}  // namespace fiducap
