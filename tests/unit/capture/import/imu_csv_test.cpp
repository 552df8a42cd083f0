#include "capture/import/imu_csv.hpp"

#include <gmock/gmock.h>

#include <numbers>

#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::Contains;
using testing::HasSubstr;

class ImuCsvTest : public testing::Test {
 protected:
  Expected<ImuTable> read(const std::string& text) {
    return read_imu_csv(folder_.write("imu.csv", text), options_);
  }
  TemporaryFolder folder_;
  ImportOptions options_;
};

TEST(ParseTime, DigitsBecomeNanosecondsWithoutADouble) {
  std::int64_t ns = 0;
  ASSERT_TRUE(parse_time("1403636579.763555123", 9, ns));
  EXPECT_EQ(ns, 1'403'636'579'763'555'123);
  ASSERT_TRUE(parse_time("1403636579763555123", 0, ns));
  EXPECT_EQ(ns, 1'403'636'579'763'555'123);
  ASSERT_TRUE(parse_time("12.5", 6, ns));
  EXPECT_EQ(ns, 12'500'000);
  ASSERT_TRUE(parse_time("-0.25", 9, ns));
  EXPECT_EQ(ns, -250'000'000);
  ASSERT_TRUE(parse_time("1.5e2", 3, ns));
  EXPECT_EQ(ns, 150'000);
  for (const char* wrong : {"", "x", "1.x", "99999999999999999999", "1e300"})
    EXPECT_FALSE(parse_time(wrong, 9, ns)) << wrong;
}

TEST_F(ImuCsvTest, UnitsAreSeenByTheNumbersAndSaid) {
  std::string text = "t,gx,gy,gz,ax,ay,az\n";
  for (int i = 0; i < 200; ++i)
    text += std::to_string(5000 * i) + ",90,-45,0,0,0,1\n";  // µs, deg/s, g
  const auto table = read(text);
  ASSERT_TRUE(table) << table.error().text();
  ASSERT_EQ(table->samples.size(), 200u);
  EXPECT_EQ(to_ns(table->samples[1].sampled_at), 5'000'000);
  EXPECT_NEAR(table->samples[0].w_WB_B.x(), std::numbers::pi / 2, 1e-12);
  EXPECT_NEAR(table->samples[0].f_B.z(), 9.80665, 1e-12);
  EXPECT_THAT(table->remarks, Contains(HasSubstr("time is taken for µs")));
  EXPECT_THAT(table->remarks, Contains(HasSubstr("the gyro is taken for deg/s")));
  EXPECT_THAT(table->remarks, Contains(HasSubstr("the accelerometer is taken for g")));
}

TEST_F(ImuCsvTest, SecondsSinceThen) {
  std::string text = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n";
  for (int i = 0; i < 50; ++i)
    text += "1600000000." + std::to_string(1000 + 10 * i).substr(1) + ",0.1,0,0,0,9.8,0\n";
  const auto table = read(text);
  ASSERT_TRUE(table) << table.error().text();
  EXPECT_EQ(to_ns(table->samples[1].sampled_at), 1'600'000'000'010'000'000);
  EXPECT_DOUBLE_EQ(table->samples[0].w_WB_B.x(), 0.1);
  EXPECT_DOUBLE_EQ(table->samples[0].f_B.y(), 9.8);
}

TEST_F(ImuCsvTest, WithoutAHeaderTheUsualOrderIsTakenAndSaid) {
  const auto table = read("0,1,2,3,0,0,9.8\n5000000,1,2,3,0,0,9.8\n");
  ASSERT_TRUE(table) << table.error().text();
  EXPECT_EQ(table->samples.size(), 2u);
  EXPECT_THAT(table->remarks, Contains(HasSubstr("has no header")));
}

TEST_F(ImuCsvTest, BrokenAndBackwardLinesAreCountedAndLeftOut) {
  const auto table = read(
      "t_ms,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n5,0,0,0,0,0,9.8\n3,0,0,0,0,0,9.8\n"
      "10,0,0,nan,0,0,9.8\n15,0,0\n20,0,0,0,0,0,9.8\n25,0,0,0,0,0,9.");
  ASSERT_TRUE(table) << table.error().text();
  EXPECT_EQ(table->samples.size(), 3u);
  EXPECT_EQ(table->found.backwards, 1u);
  EXPECT_EQ(table->found.unreadable, 2u);
}

TEST_F(ImuCsvTest, AnErrorNamesFileAndColumn) {
  const auto table = read("t,gx,gy,gz\n0,1,2,3\n");
  ASSERT_FALSE(table);
  EXPECT_THAT(table.error().text(), HasSubstr("imu.csv: no column for accelerometer x"));
  EXPECT_FALSE(read(""));
  EXPECT_FALSE(read("t,gx,gy,gz,ax,ay,az\n"));
  EXPECT_FALSE(read_imu_csv(folder_.file("nothing.csv"), options_));
}

}  // namespace
}  // namespace fiducap
