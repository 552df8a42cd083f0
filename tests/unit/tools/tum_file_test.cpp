#include "tools/replay/tum_file.hpp"

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

}  // namespace
}  // namespace fiducap
