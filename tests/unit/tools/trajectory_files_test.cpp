#include "tools/replay/trajectory_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using ::testing::HasSubstr;

// (2, 4, 5, 6)/9 is a unit quaternion with four different parts: no swapped order can pass. Eigen
// takes w x y z.
const Pose kPose{{2 / 9., 4 / 9., 5 / 9., 6 / 9.}, {1.5, -2.25, 0.125}};

TEST(TumFile, StampsKeepEveryNanosecond) {
  const std::vector<StampedPose> poses{{instant_from_ns(1'600'000'000'000'000'001), kPose},
                                       {instant_from_ns(1'600'000'000'999'999'999), kPose}};
  const std::string text = to_tum(poses);
  EXPECT_EQ(text.rfind("1600000000.000000001 1.5 -2.25 0.125 0.4444", 0), 0u) << text;
  const auto read = tum_from(text, "test").value();
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].at, poses[0].at);
  EXPECT_EQ(read[1].at, poses[1].at);
}

TEST(TumFile, WritesTheQuaternionWithWLast) {
  EXPECT_THAT(
      to_tum(std::vector<StampedPose>{{instant_from_ns(0), kPose}}),
      HasSubstr("0.4444444444444444 0.5555555555555556 0.6666666666666666 0.2222222222222222\n"));
}

TEST(TumFile, ReadsPosesBackToTheLastBit) {
  const auto read =
      tum_from(to_tum(std::vector<StampedPose>{{instant_from_ns(5), kPose}}), "test").value();
  EXPECT_EQ(read[0].X_WB.p, kPose.p);
  EXPECT_LT(read[0].X_WB.q.angularDistance(kPose.q), 1e-15);
}

TEST(TumFile, ReadsFilesOfOtherPrograms) {
  const auto read =
      tum_from("# comment\n\n 12.5\t1 2 3  0 0 0 1\r\n13 1 2 3 0 0 0 -1", "test").value();
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(to_ns(read[0].at), 12'500'000'000);
  EXPECT_EQ(to_ns(read[1].at), 13'000'000'000);
}

TEST(TumFile, NamesTheLineThatIsNoPose) {
  for (const char* bad :
       {"1 2 3", "1 0 0 0 0 0 0 2", "x 0 0 0 0 0 0 1", "1 0 0 nan 0 0 0 1", "1 0 0 0 0 0 0 1 9",
        "-1 0 0 0 0 0 0 1", "1.5x 0 0 0 0 0 0 1", "99999999999 0 0 0 0 0 0 1"}) {
    const auto read = tum_from(std::string("0 0 0 0 0 0 0 1\n") + bad + "\n", "file.tum");
    ASSERT_FALSE(read) << bad;
    EXPECT_EQ(read.error().context, "file.tum:2") << bad;
  }
}

TEST(TumFile, RefusesTimeThatDoesNotIncrease) {
  EXPECT_FALSE(tum_from("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "test"));
}

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
