#include "tools/live/live_verbs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <nlohmann/json.hpp>

namespace fiducap {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Frame frame() {
  Frame f;
  f.number = 42;
  f.map_version = 3;
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
  f.bodies = {body};
  return f;
}

ClientStatistics statistics() {
  ClientStatistics s;
  s.connected = true;
  s.rate_hz = 99.96;
  s.lost = 7;
  s.latency_p50_s = 0.00025;
  s.latency_p99_s = std::numeric_limits<double>::quiet_NaN();
  return s;
}

TEST(WatchView, TableShowsPoseSpeedAndLoss) {
  const std::string table = watch_table("hall:21600", frame(), statistics());
  EXPECT_THAT(
      table,
      HasSubstr(
          "hall:21600  frame 42  100.0 Hz  latency p50 0.25 ms p99 unknown  lost 7  map v3\n"));
  EXPECT_THAT(table, HasSubstr("drone            tracking     1.250   -2.500    0.375     90.0"));
  EXPECT_THAT(table, HasSubstr(" 5.00 "));
}

TEST(WatchView, ColumnsStandBelowTheirNames) {
  const std::string table = watch_table("s", frame(), statistics());
  const std::size_t names = table.find('\n') + 1;
  const std::size_t row = table.find('\n', names) + 1;
  EXPECT_EQ(row - names, table.size() - row) << table;
}

TEST(WatchView, AnInvalidPoseIsNotShown) {
  Frame f = frame();
  f.bodies[0].valid = false;
  EXPECT_THAT(watch_table("s", f, statistics()), Not(HasSubstr("1.250")));
  EXPECT_THAT(watch_lines(f, statistics()), Not(HasSubstr("1.250")));
}

TEST(WatchView, ASilentServerIsSaid) {
  ClientStatistics s = statistics();
  s.connected = false;
  EXPECT_THAT(watch_table("s", frame(), s), HasSubstr("NOT ANSWERING"));
}

TEST(WatchView, JsonIsOneLineWithUnknownAsNull) {
  const std::string text = watch_json(frame(), statistics());
  EXPECT_EQ(text.find('\n'), text.size() - 1);
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json["frame"], 42);
  EXPECT_TRUE(json["latency_p99_s"].is_null());
  EXPECT_EQ(json["bodies"][0]["position_m"], (std::vector<double>{1.25, -2.5, 0.375}));
  EXPECT_EQ(json["bodies"][0]["tracking"], "tracking");
}

}  // namespace
}  // namespace fiducap
