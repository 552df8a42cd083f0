#include "capture/recording/csv_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kDay_ms = 86'400'000;

class StampColumnTest : public testing::Test {
 protected:
  /// Milliseconds, a line each. @return the lines that are not accepted
  std::vector<std::uint64_t> left_out(const std::vector<std::int64_t>& stamps_ms) {
    std::string text;
    for (const std::int64_t ms : stamps_ms) text += std::to_string(ms * 1'000'000) + ",x\n";
    auto column = StampColumn::read(folder_.write("data.csv", text));
    EXPECT_TRUE(column) << column.error().text();
    std::vector<std::uint64_t> lines;
    for (std::uint64_t line = 1; line <= stamps_ms.size(); ++line)
      if (!column->accepts(line)) lines.push_back(line);
    EXPECT_EQ(column->left_out(), lines.size());
    first_ms_ = to_ns(column->first()) / 1'000'000;
    last_ms_ = to_ns(column->last()) / 1'000'000;
    step_ = column->step();
    return lines;
  }

  TemporaryFolder folder_;
  std::int64_t first_ms_{};
  std::int64_t last_ms_{};
  Duration step_{};
};

TEST_F(StampColumnTest, TimeThatGoesForwardIsKeptRowsOfOneImageAndPausesToo) {
  EXPECT_THAT(left_out({1000, 1000, 1050, 1100, 1100, 1150, 700'000, 700'050}), IsEmpty());
  EXPECT_EQ(step_, std::chrono::milliseconds(50));
  EXPECT_EQ(first_ms_, 1000);
  EXPECT_EQ(last_ms_, 700'050);
}

TEST_F(StampColumnTest, OneWrongStampIsLeftOutWhereverItIs) {
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

TEST_F(StampColumnTest, OfAClockThatWasSetBackTheLongerPartStays) {
  EXPECT_THAT(left_out({100, 150, 10, 60, 110, 160, 210}), ElementsAre(1, 2));
  EXPECT_THAT(left_out({100, 150, 200, 250, 10, 60}), ElementsAre(5, 6));
}

TEST_F(StampColumnTest, OfGroupsMoreThanAnHourApartTheLargestStays) {
  EXPECT_THAT(left_out({1, 2, kDay_ms, kDay_ms + 1, kDay_ms + 2, 2 * kDay_ms}),
              ElementsAre(1, 2, 6));
}

TEST_F(StampColumnTest, ALateLineGivesWayToThoseBeforeIt) {
  EXPECT_THAT(left_out({1, 2, 4, 3, 5}), ElementsAre(4));
}

TEST_F(StampColumnTest, ManyLinesInDescendingOrderAreJudgedAtOnce) {
  std::vector<std::int64_t> stamps;
  for (std::int64_t i = 300'000; i > 0; --i) stamps.push_back(i);
  EXPECT_EQ(left_out(stamps).size(), stamps.size() - 1);
}

TEST_F(StampColumnTest, SaysWhatStandsWhereAStampShould) {
  const auto column = StampColumn::read(
      folder_.write("data.csv", "timestamp,w\n1600000000.25,1\n1600000000.30,1\n"));
  ASSERT_TRUE(column);
  EXPECT_EQ(column->stamps(), 0u);
  EXPECT_EQ(column->unreadable(), 3u);
  EXPECT_EQ(column->first_unreadable(), "1600000000.25");
}

}  // namespace
}  // namespace fiducap
