#include <numbers>

#include <gmock/gmock.h>

#include "base/gravity.hpp"
#include "capture/import/imu_csv.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180;

Expected<ImuColumns> columns_of(const std::string& header) {
  return find_imu_columns(split_header(header), "", "");
}

TEST(ImuColumns, AreFoundInHeadersOfManyKinds) {
  const struct {
    const char* header;
    int exponent;
    double gyro, accel;
  } kCases[] = {
      {"#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
       "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
       0, 1, 1},
      {"timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z", -1, 0, 0},
      {"t_us,gx,gy,gz,ax,ay,az", 3, 0, 0},
      {"time_ms,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_g,acc_y_g,acc_z_g", 6, kDegree,
       kStandardGravity_m_s2},
      {"\xef\xbb\xbf\"Time (s)\",\"GyroX (deg/s)\",\"GyroY (deg/s)\",\"GyroZ (deg/s)\","
       "\"AccX (m/s^2)\",\"AccY (m/s^2)\",\"AccZ (m/s^2)\"\r",
       9, kDegree, 1},
      {"%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
       "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z",
       -1, 0, 0},
      {"seconds_elapsed,motionRotationRateX(rad/s),motionRotationRateY(rad/s),"
       "motionRotationRateZ(rad/s),accelerometerAccelerationX(G),"
       "accelerometerAccelerationY(G),accelerometerAccelerationZ(G)",
       9, 1, kStandardGravity_m_s2},
  };
  for (const auto& c : kCases) {
    SCOPED_TRACE(c.header);
    const ImuColumns columns = value_of(columns_of(c.header));
    EXPECT_EQ(columns.time, 0u);
    EXPECT_THAT(columns.gyro, ElementsAre(1, 2, 3));
    EXPECT_THAT(columns.accel, ElementsAre(4, 5, 6));
    EXPECT_EQ(columns.time_exponent, c.exponent);
    EXPECT_DOUBLE_EQ(columns.gyro_unit, c.gyro);
    EXPECT_DOUBLE_EQ(columns.accel_unit, c.accel);
  }
}

TEST(ImuColumns, CountAxesFromZeroOrOneAndKnowTheirUnits) {
  const ImuColumns matlab = value_of(columns_of(
      "Time,Gyroscope_1,Gyroscope_2,Gyroscope_3,Acceleration_1,Acceleration_2,Acceleration_3"));
  EXPECT_THAT(matlab.gyro, ElementsAre(1, 2, 3));
  EXPECT_THAT(matlab.accel, ElementsAre(4, 5, 6));
  EXPECT_DOUBLE_EQ(
      value_of(columns_of("t[us],gx[mdps],gy[mdps],gz[mdps],ax[mg],ay[mg],az[mg]")).gyro_unit,
      kDegree / 1000);
  EXPECT_THAT(error_of(columns_of("t,gx[rpm],gy[rpm],gz[rpm],ax,ay,az")),
              HasSubstr("the unit of 'gx[rpm]' is not known"));
}

TEST(ImuColumns, IgnoreOtherColumnsAndNameMissingOnes) {
  const ImuColumns columns = value_of(columns_of(
      "time,mag_x,mag_y,mag_z,userAccX,userAccY,userAccZ,gravityX,ax,ay,az,gx,gy,gz,temp"));
  EXPECT_THAT(columns.accel, ElementsAre(8, 9, 10));
  EXPECT_THAT(columns.gyro, ElementsAre(11, 12, 13));
  EXPECT_THAT(error_of(columns_of("time,gx,gy,ax,ay,az,light")),
              HasSubstr("no column for gyro z; there is: time, gx, gy, ax"));
}

TEST(ImuColumns, MayBeNamedWithTheirUnits) {
  const auto header = split_header("a,b,c,d,e,f,g");
  const ImuColumns columns = value_of(find_imu_columns(header, "g,f,e,d,c,b,a", "us,deg/s,g"));
  EXPECT_EQ(columns.time, 6u);
  EXPECT_THAT(columns.gyro, ElementsAre(5, 4, 3));
  EXPECT_THAT(columns.accel, ElementsAre(2, 1, 0));
  EXPECT_EQ(columns.time_exponent, 3);
  EXPECT_FALSE(find_imu_columns(header, "a,b", ""));
  EXPECT_FALSE(find_imu_columns(header, "a,b,c,d,e,f,x", ""));
  EXPECT_FALSE(find_imu_columns(header, "a,b,c,d,e,f,g", "furlongs,deg/s,g"));
}

VectorReading reading(std::int64_t ms, double x) { return {ms * 1'000'000, {x, 0, 0}}; }

TEST(ImuPairs, InterpolateTheAccelerometerAtTheTimesOfTheGyro) {
  const auto pairs = pair_readings({reading(10, 1), reading(15, 2), reading(20, 3)},
                                   {reading(10, 100), reading(20, 200)});
  ASSERT_EQ(pairs.samples.size(), 3u);
  EXPECT_EQ(pairs.samples[0].f_B.x(), 100);
  EXPECT_DOUBLE_EQ(pairs.samples[1].f_B.x(), 150);
  EXPECT_EQ(pairs.samples[1].w_WB_B.x(), 2);
  EXPECT_EQ(pairs.samples[2].f_B.x(), 200);
}

TEST(ImuPairs, AreNotExtrapolatedNorMadeInGaps) {
  const auto pairs =
      pair_readings({reading(5, 1), reading(60, 2), reading(250, 3), reading(900, 4)},
                    {reading(10, 1), reading(100, 1), reading(400, 1)});
  ASSERT_EQ(pairs.samples.size(), 1u);
  EXPECT_EQ(to_ns(pairs.samples[0].sampled_at), 60'000'000);
  EXPECT_EQ(pairs.alone, 3u);
}

TEST(ImuPairs, AreSortedAndUnique) {
  std::vector<VectorReading> readings{reading(2, 2), reading(1, 1), reading(2, 3), reading(3, 3)};
  EXPECT_EQ(put_in_order(readings), 1u);
  ASSERT_EQ(readings.size(), 3u);
  EXPECT_EQ(readings[1].value.x(), 2) << "the first of two stays";
}

class ImuCsvTest : public testing::Test {
 protected:
  Expected<ImuTable> read(const std::string& text) {
    return read_imu_csv(folder_.write("imu.csv", text), options_);
  }
  TemporaryFolder folder_;
  ImportOptions options_;
};

TEST(ParseTime, ReadsDigitsExactly) {
  const struct {
    const char* text;
    int exponent;
    std::int64_t ns;
  } kCases[] = {{"1403636579.763555123", 9, 1'403'636'579'763'555'123},
                {"1403636579763555123", 0, 1'403'636'579'763'555'123},
                {"12.5", 6, 12'500'000},
                {"-0.25", 9, -250'000'000},
                {"1.5e2", 3, 150'000}};
  std::int64_t ns = 0;
  for (const auto& [text, exponent, expected] : kCases) {
    ASSERT_TRUE(parse_time(text, exponent, ns)) << text;
    EXPECT_EQ(ns, expected);
  }
  for (const char* wrong : {"", "x", "1.x", "99999999999999999999", "1e300"})
    EXPECT_FALSE(parse_time(wrong, 9, ns)) << wrong;
}

TEST_F(ImuCsvTest, InfersAndReportsUnitsFromTheNumbers) {
  std::string text = "t,gx,gy,gz,ax,ay,az\n";
  for (int i = 0; i < 200; ++i)
    text += std::to_string(5000 * i) + ",90,-45,0,0,0,1\n";  // µs, deg/s, g
  const ImuTable table = value_of(read(text));
  ASSERT_EQ(table.samples.size(), 200u);
  EXPECT_EQ(to_ns(table.samples[1].sampled_at), 5'000'000);
  EXPECT_NEAR(table.samples[0].w_WB_B.x(), std::numbers::pi / 2, 1e-12);
  EXPECT_NEAR(table.samples[0].f_B.z(), 9.80665, 1e-12);
  for (const char* remark : {"time is assumed in µs", "the gyro is assumed in deg/s",
                             "the accelerometer is assumed in g"})
    EXPECT_THAT(table.remarks, Contains(HasSubstr(remark)));
}

TEST_F(ImuCsvTest, ReadsSecondsOfTheUnixEpoch) {
  std::string text = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n";
  for (int i = 0; i < 50; ++i)
    text += "1600000000." + std::to_string(1000 + 10 * i).substr(1) + ",0.1,0,0,0,9.8,0\n";
  const ImuTable table = value_of(read(text));
  EXPECT_EQ(to_ns(table.samples[1].sampled_at), 1'600'000'000'010'000'000);
  EXPECT_DOUBLE_EQ(table.samples[0].w_WB_B.x(), 0.1);
  EXPECT_DOUBLE_EQ(table.samples[0].f_B.y(), 9.8);
}

TEST_F(ImuCsvTest, AssumesAndReportsTheUsualOrderWithoutAHeader) {
  const ImuTable table = value_of(read("0,1,2,3,0,0,9.8\n5000000,1,2,3,0,0,9.8\n"));
  EXPECT_EQ(table.samples.size(), 2u);
  EXPECT_THAT(table.remarks, Contains(HasSubstr("has no header")));
}

TEST_F(ImuCsvTest, FindsTheSeparatorAndDecimalCommas) {
  const char* const names[] = {"time_ms", "gx", "gy", "gz", "ax", "ay", "az"};
  for (const std::string separator : {",", ";", "\t", "  "}) {
    std::string text = separator == "  " ? "# " : "";
    for (const char* name : names) text += (name == names[0] ? "" : separator) + std::string(name);
    for (int i = 1; i <= 3; ++i) {
      text += "\n" + std::to_string(5 * i);
      for (const std::string number : {"0.25", "-1", "2", "3", "4", "9.75"})
        text += separator + (separator == ";" && number == "0.25" ? "0,25" : number);
    }
    const ImuTable table = value_of(read(text + "\n"));
    ASSERT_EQ(table.samples.size(), 3u) << text;
    EXPECT_EQ(table.samples[0].w_WB_B, Eigen::Vector3d(0.25, -1, 2)) << text;
    EXPECT_EQ(table.samples[0].f_B, Eigen::Vector3d(3, 4, 9.75)) << text;
    EXPECT_EQ(to_ns(table.samples[2].sampled_at), 15'000'000);
  }
}

TEST_F(ImuCsvTest, ReadsTablesOfPx4AndSensorLog) {
  const ImuTable px4 =
      value_of(read("timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,"
                    "accelerometer_timestamp_relative,accelerometer_m_s2[0],accelerometer_m_s2[1],"
                    "accelerometer_m_s2[2]\n40000,1,2,3,4,5,6,7,9\n44000,1,2,3,4,5,6,7,9\n"));
  EXPECT_EQ(px4.samples.at(1).w_WB_B, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(px4.samples[1].f_B, Eigen::Vector3d(6, 7, 9));
  EXPECT_EQ(to_ns(px4.samples[1].sampled_at), 44'000'000);
  const ImuTable betaflight = value_of(
      read("loopIteration,time (us),axisP[0],gyroADC[0] (deg/s),gyroADC[1] (deg/s),"
           "gyroADC[2] (deg/s),accSmooth[0] (g),accSmooth[1] (g),accSmooth[2] (g),motor[0]\n"
           "0,5000,9,180,0,0,0,0,1,9\n1,6000,9,180,0,0,0,0,1,9\n"));
  EXPECT_NEAR(betaflight.samples.at(1).w_WB_B.x(), 3.14159265, 1e-6);
  EXPECT_NEAR(betaflight.samples[1].f_B.z(), 9.80665, 1e-6);
  EXPECT_EQ(to_ns(betaflight.samples[1].sampled_at), 6'000'000);
  const ImuTable ios = value_of(
      read("loggingTime(txt),accelerometerTimestamp_sinceReboot(s),accelerometerAccelerationX(G),"
           "accelerometerAccelerationY(G),accelerometerAccelerationZ(G),gyroRotationX(rad/s),"
           "gyroRotationY(rad/s),gyroRotationZ(rad/s)\n"
           "2026-11-29 10:00:00.123 +0100,5.01,0,0,-1,1,2,3\n"
           "2026-11-29 10:00:00.133 +0100,5.02,0,0,-1,1,2,3\n"));
  EXPECT_EQ(to_ns(ios.samples.at(0).sampled_at), 5'010'000'000);
  EXPECT_NEAR(ios.samples[0].f_B.z(), 9.80665, 1e-12) << "screen up";
  EXPECT_THAT(ios.remarks, Contains(HasSubstr("its sign is inverted")));
}

TEST_F(ImuCsvTest, BelievesTheStepsMoreThanAHeaderOfEuroc) {
  for (const auto& [a, b] :
       {std::pair("1600000000.005", "1600000000.010"), std::pair("1600000000005", "1600000000010"),
        std::pair("1600000000005000", "1600000000010000"),
        std::pair("1600000000005000000", "1600000000010000000")}) {
    const std::string rest = ",0,0,0,0,0,9.8\n";
    const ImuTable table =
        value_of(read("#timestamp [ns],wx,wy,wz,ax,ay,az\n" + (a + rest) + b + rest));
    EXPECT_EQ(to_ns(table.samples.at(1).sampled_at), 1'600'000'000'010'000'000) << a;
  }
}

TEST_F(ImuCsvTest, ReadsDates) {
  const struct {
    const char* text;
    std::int64_t ns;  // −1: none
  } kCases[] = {{"2026-11-29T10:00:00.123Z", 1'795'946'400'123'000'000},
                {"2026-11-29 11:00:00.123456 +01:00", 1'795'946'400'123'456'000},
                {"2026/11/29 04:30:00,5-0530", 1'795'946'400'500'000'000},
                {"00:01:02.5", 62'500'000'000},
                {"1795946400.123", -1},
                {"2026-02-30 10:00:00", -1},
                {"4052-11-29 10:00:00", -1},  // beyond 64 bits of ns
                {"2026-11-29", -1},
                {"10:61:00", -1},
                {"", -1}};
  for (const auto& [text, expected] : kCases) {
    std::int64_t ns = -1;
    EXPECT_EQ(parse_date(text, ns), expected >= 0) << text;
    if (expected >= 0) EXPECT_EQ(ns, expected) << text;
  }
  const ImuTable table =
      value_of(read("date,gx,gy,gz,ax,ay,az\n2026-11-29T10:00:00.123,0,0,0,0,0,9.8\n"
                    "2026-11-29T10:00:00.128,0,0,0,0,0,9.8\n"));
  EXPECT_EQ(to_ns(table.samples.at(1).sampled_at), 1'795'946'400'128'000'000);
}

TEST_F(ImuCsvTest, DropsAndCountsDamagedAndBackwardLines) {
  const ImuTable table =
      value_of(read("t_ms,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n5,0,0,0,0,0,9.8\n3,0,0,0,0,0,9.8\n"
                    "10,0,0,nan,0,0,9.8\n15,0,0\n20,0,0,0,0,0,9.8\n25,0,0,0,0,0,9."));
  EXPECT_EQ(table.samples.size(), 3u);
  EXPECT_EQ(table.found.backwards, 1u);
  EXPECT_EQ(table.found.unreadable, 2u);
}

TEST_F(ImuCsvTest, RefusesFilesWithoutColumnsOrLines) {
  EXPECT_THAT(error_of(read("t,gx,gy,gz\n0,1,2,3\n")),
              HasSubstr("imu.csv: no column for accelerometer x"));
  EXPECT_FALSE(read(""));
  EXPECT_FALSE(read("t,gx,gy,gz,ax,ay,az\n"));
  EXPECT_FALSE(read_imu_csv(folder_.file("nothing.csv"), options_));
}

}  // namespace
}  // namespace fiducap
