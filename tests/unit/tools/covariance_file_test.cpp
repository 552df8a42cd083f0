#include "tools/replay/covariance_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using ::testing::HasSubstr;

std::string line_of(const std::string& stamp, const std::string& last = "1e-6") {
  std::string line = stamp + ",1e-6,0,0,0,0,0,1e-6,0,0,0,0,1e-6,0,0,0,1e-6,0,0,1e-6,0," + last;
  return line + "\n";
}

TEST(CovarianceFile, WhatIsWrittenReadsBackAsTheSameNumbers) {
  StampedCovariance one{instant_from_ns(1'600'000'000'123'456'789), Matrix6d::Zero()};
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      one.covariance(row, column) = one.covariance(column, row) =
          (row == column ? 1. : -0.1) / (3 + row + 7 * column);
  const std::vector<StampedCovariance> written{one, {one.at + Duration{1}, one.covariance / 3}};
  const auto read = covariances_from_csv(to_covariance_csv(written), "c.csv");
  ASSERT_TRUE(read) << read.error().text();
  ASSERT_EQ(read->size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ((*read)[i].at, written[i].at);
    EXPECT_EQ((*read)[i].covariance, written[i].covariance);
  }
}

TEST(CovarianceFile, CommentsAndEmptyLinesAreSkipped) {
  const auto read = covariances_from_csv("#t_ns,P00\n\n" + line_of("5"), "c.csv");
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->size(), 1u);
  EXPECT_TRUE(covariances_from_csv("", "c.csv"));
}

TEST(CovarianceFile, SaysWhichLineIsNoCovariance) {
  for (const std::string& bad :
       {line_of("x"), line_of("5.5"), line_of("5", "nan"), line_of("5", "-1e-6"),
        line_of("5", "1e-6,0"), line_of("5", ""), std::string("5,1,2\n"), line_of("4"),
        line_of("99999999999999999999")}) {
    const auto read = covariances_from_csv(line_of("4") + bad, "c.csv");
    ASSERT_FALSE(read) << bad;
    EXPECT_THAT(read.error().text(), HasSubstr("c.csv:2")) << bad;
  }
}

}  // namespace
}  // namespace fiducap
