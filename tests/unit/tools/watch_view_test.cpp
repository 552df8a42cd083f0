#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include <nlohmann/json.hpp>

#include "tools/live/live_verbs.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class WatchView : public ::testing::Test {
 protected:
  WatchView() {
    frame_.number = 42;
    frame_.map_version = 3;
    Body body;
    body.id = 1;
    body.name = "drone";
    body.tracking = Tracking::kTracking;
    body.valid = true;
    body.position_m = {1.25, -2.5, 0.375};
    body.orientation_wxyz = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)};  // heading 90 degrees
    body.velocity_m_s = {3, 0, 4};
    body.position_sigma_m = 0.0042;
    body.age_s = 0.037;
    body.tags_in_view = 5;
    frame_.bodies = {body};
    statistics_.connected = true;
    statistics_.rate_hz = 99.96;
    statistics_.lost = 7;
    statistics_.latency_p50_s = 0.00025;
    statistics_.latency_p99_s = std::numeric_limits<double>::quiet_NaN();
  }
  [[nodiscard]] std::string table() const { return watch_table("hall:21600", frame_, statistics_); }

  Frame frame_;
  ClientStatistics statistics_;
};

TEST_F(WatchView, TableHasPoseSpeedAndLoss) {
  EXPECT_THAT(
      table(),
      testing::AllOf(
          HasSubstr("hall:21600  frame 42  100.0 Hz  latency p50 0.25 ms p99 unknown  lost 7  "
                    "map v3\n"),
          HasSubstr("drone            tracking     1.250   -2.500    0.375     90.0"),
          HasSubstr(" 5.00 ")));
}

TEST_F(WatchView, ColumnsAreBelowTheirNames) {
  const std::string text = table();
  const std::size_t names = text.find('\n') + 1;
  const std::size_t row = text.find('\n', names) + 1;
  EXPECT_EQ(row - names, text.size() - row) << text;
}

TEST_F(WatchView, LinesHaveNamesWhenAsked) {
  const std::string with = watch_lines(frame_, statistics_, true);
  EXPECT_THAT(with, HasSubstr("body             state"));
  EXPECT_THAT(with, HasSubstr("[deg/s]"));
  EXPECT_THAT(watch_lines(frame_, statistics_, false), Not(HasSubstr("body             state")));
}

TEST_F(WatchView, HidesInvalidPosesAndReportsSilence) {
  frame_.bodies[0].valid = false;
  EXPECT_THAT(table(), Not(HasSubstr("1.250")));
  EXPECT_THAT(watch_lines(frame_, statistics_, false), Not(HasSubstr("1.250")));
  statistics_.connected = false;
  EXPECT_THAT(table(), HasSubstr("NOT ANSWERING"));
}

TEST_F(WatchView, JsonIsOneLineWithUnknownAsNull) {
  const std::string text = watch_json(frame_, statistics_, 3);
  EXPECT_EQ(text.find('\n'), text.size() - 1);
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json["frame"], 42);
  EXPECT_EQ(json["skipped"], 3);
  EXPECT_TRUE(json["latency_p99_s"].is_null());
  EXPECT_EQ(json["bodies"][0]["position_m"], (std::vector<double>{1.25, -2.5, 0.375}));
  EXPECT_EQ(json["bodies"][0]["tracking"], "tracking");
}

TEST_F(WatchView, QueueKeepsEveryFrameInOrderAndCountsThoseBeyondItsSize) {
  FrameQueue queue;
  for (std::uint64_t i = 1; i <= FrameQueue::kMost + 2; ++i) {
    frame_.number = i;
    queue.push(frame_);
  }
  EXPECT_EQ(queue.skipped(), 2);
  for (std::uint64_t i = 1; i <= FrameQueue::kMost; ++i)
    ASSERT_EQ(queue.pop(std::chrono::milliseconds(0)).value().number, i);
  EXPECT_FALSE(queue.pop(std::chrono::milliseconds(0)));
}

}  // namespace
}  // namespace fiducap
