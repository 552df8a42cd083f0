#include "capture/imu/imu_source_config.hpp"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <vector>

namespace fiducap {
namespace {

constexpr double kRounding = 1e-12;

ImuAxes read(const std::string& yaml) {
  ImuAxes axes;
  EXPECT_EQ(read_value(YAML::Load(yaml), axes), std::nullopt) << yaml;
  return axes;
}

std::optional<std::string> fault_of(const std::string& yaml) {
  ImuAxes axes;
  const auto fault = read_value(YAML::Load(yaml), axes);
  EXPECT_EQ(axes.R_BS, Eigen::Matrix3d::Identity()) << "nothing is half read";
  return fault;
}

TEST(ImuAxes, AreTakenAsTheyComeUnlessSaidOtherwise) {
  EXPECT_FALSE(ImuAxes{}.is_turned());
  EXPECT_FALSE(read("flu").is_turned());
  EXPECT_FALSE(read("[x, y, z]").is_turned());
}

TEST(ImuAxes, OfAnAutopilotAtRestFeelGravityUpwards) {
  // Forward, right, down: what holds it up points against z.
  const Eigen::Vector3d f_B = read("frd").R_BS * Eigen::Vector3d(0, 0, -9.81);
  EXPECT_EQ(f_B, Eigen::Vector3d(0, 0, 9.81));
}

TEST(ImuAxes, OfACameraThatLooksAheadHaveForwardInZ) {
  const Eigen::Matrix3d R_BS = read("camera").R_BS;
  EXPECT_EQ(R_BS * Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 0, 0)) << "forward";
  EXPECT_EQ(R_BS * Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(0, 1, 0)) << "left";
  EXPECT_EQ(R_BS * Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0, 0, 1)) << "up";
}

TEST(ImuAxes, ThreeAxesSayWhereEachBodyAxisIsFound) {
  const Eigen::Vector3d reading(1, 2, 3);
  EXPECT_EQ(read("[y, -x, z]").R_BS * reading, Eigen::Vector3d(2, -1, 3));
  EXPECT_EQ(read("[-z, +y, x]").R_BS * reading, Eigen::Vector3d(-3, 2, 1));
}

TEST(ImuAxes, AQuaternionTurnsReadingsIntoTheBody) {
  // A quarter turn about z: the unit's x points to the left.
  const Eigen::Matrix3d R_BS = read("[0.70711, 0, 0, 0.70711]").R_BS;
  EXPECT_NEAR((R_BS * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 1, 0)).norm(), 0, kRounding);
  EXPECT_NEAR(R_BS.determinant(), 1, kRounding);
}

TEST(ImuAxes, MirroredDoubledAndUnknownAxesAreRefused) {
  for (const char* wrong :
       {"[y, x, z]", "[x, y, -z]", "[x, x, z]", "[x, y]", "[x, y, w]", "[x, y, zz]", "ned",
        "[1, 0, 0, 1]", "[a, 0, 0, 1]", "{x: y}", "[]", "[x, [y], z]", "[nan, 0, 0, 0]"}) {
    const auto fault = fault_of(wrong);
    ASSERT_TRUE(fault) << wrong;
    EXPECT_NE(fault->find("right-handed"), std::string::npos);
  }
}

TEST(ImuAxes, ArePrintedAsTheyWereWritten) {
  for (const char* text : {"flu", "camera", "[y, -x, z]", "[0, 1, 0, 0]"})
    EXPECT_EQ(text_of(read(text)), text);
}

}  // namespace
}  // namespace fiducap
