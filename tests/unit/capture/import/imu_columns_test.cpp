#include "capture/import/imu_columns.hpp"

#include <gmock/gmock.h>

#include <numbers>

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180;

Expected<ImuColumns> columns_of(const std::string& header) {
  return find_imu_columns(split_header(header), "", "");
}

TEST(ImuColumns, HeadersOfManyKindsAreUnderstood) {
  struct Case {
    const char* header;
    int exponent;
    double gyro;
    double accel;
  };
  for (const Case& c : {
           Case{"#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
                "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
                0, 1, 1},
           Case{"timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z", -1, 0, 0},
           Case{"t_us,gx,gy,gz,ax,ay,az", 3, 0, 0},
           Case{"time_ms,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_g,acc_y_g,acc_z_g", 6, kDegree,
                kStandardGravity_m_s2},
           Case{"\xef\xbb\xbf\"Time (s)\",\"GyroX (deg/s)\",\"GyroY (deg/s)\",\"GyroZ (deg/s)\","
                "\"AccX (m/s^2)\",\"AccY (m/s^2)\",\"AccZ (m/s^2)\"\r",
                9, kDegree, 1},
           Case{"%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
                "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration."
                "z",
                -1, 0, 0},
           Case{"seconds_elapsed,motionRotationRateX(rad/s),motionRotationRateY(rad/s),"
                "motionRotationRateZ(rad/s),accelerometerAccelerationX(G),"
                "accelerometerAccelerationY(G),accelerometerAccelerationZ(G)",
                9, 1, kStandardGravity_m_s2},
       }) {
    const auto columns = columns_of(c.header);
    ASSERT_TRUE(columns) << c.header << ": " << columns.error().text();
    EXPECT_EQ(columns->time, 0u);
    EXPECT_THAT(columns->gyro, ElementsAre(1, 2, 3)) << c.header;
    EXPECT_THAT(columns->accel, ElementsAre(4, 5, 6)) << c.header;
    EXPECT_EQ(columns->time_exponent, c.exponent) << c.header;
    EXPECT_DOUBLE_EQ(columns->gyro_unit, c.gyro) << c.header;
    EXPECT_DOUBLE_EQ(columns->accel_unit, c.accel) << c.header;
  }
}

TEST(ImuColumns, WhatIsNoImuIsPassedOver) {
  const auto columns = columns_of(
      "time,mag_x,mag_y,mag_z,userAccX,userAccY,userAccZ,gravityX,ax,ay,az,gx,gy,gz,temp");
  ASSERT_TRUE(columns) << columns.error().text();
  EXPECT_THAT(columns->accel, ElementsAre(8, 9, 10));
  EXPECT_THAT(columns->gyro, ElementsAre(11, 12, 13));
}

TEST(ImuColumns, WhatIsMissingIsNamedWithWhatIsThere) {
  const auto columns = columns_of("time,gx,gy,ax,ay,az,light");
  ASSERT_FALSE(columns);
  EXPECT_THAT(columns.error().what, HasSubstr("no column for gyro z; there is: time, gx, gy, ax"));
}

TEST(ImuColumns, NamedColumnsAndUnitsAreTakenAsTheyAre) {
  const auto header = split_header("a,b,c,d,e,f,g");
  auto columns = find_imu_columns(header, "g,f,e,d,c,b,a", "us,deg/s,g");
  ASSERT_TRUE(columns) << columns.error().text();
  EXPECT_EQ(columns->time, 6u);
  EXPECT_THAT(columns->gyro, ElementsAre(5, 4, 3));
  EXPECT_THAT(columns->accel, ElementsAre(2, 1, 0));
  EXPECT_EQ(columns->time_exponent, 3);
  EXPECT_FALSE(find_imu_columns(header, "a,b", ""));
  EXPECT_FALSE(find_imu_columns(header, "a,b,c,d,e,f,x", ""));
  EXPECT_FALSE(find_imu_columns(header, "a,b,c,d,e,f,g", "furlongs,deg/s,g"));
}

}  // namespace
}  // namespace fiducap
