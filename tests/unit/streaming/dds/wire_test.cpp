// The bytes on the wire (OMG's XCDR version 1, little-endian) and the discovery data of writers.
#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <gmock/gmock.h>

#include "middleware/endpoints.hpp"
#include "streaming/dds/dds.hpp"
#include "streaming/dds/ros_messages.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::dds {
namespace {

class DdsWire : public testing::Test {
 protected:
  std::shared_ptr<Participant> participant_ =
      Participant::open({.domain = 44, .peers = {}}).value();
};

TEST_F(DdsWire, PoseStampedIsPlainCdr) {
  const auto topic = ros_topic("/drone/pose", RosType::kPoseStamped);
  auto reader = Reader::make(*participant_, topic, {true, false, 1, 0});
  auto writer = Writer::make(*participant_, topic, {true, false, 1, 0});
  ASSERT_TRUE(reader && writer);
  const std::string frame_id = "map";
  geometry_msgs_msg_dds__PoseStamped_ message{};
  message.header = {{0x01020304, 0x05060708}, borrowed(frame_id)};
  message.pose = {{1.0, -2.0, 0.25}, {0.5, -0.5, 0.5, -0.5}};
  ASSERT_TRUE(writer->write(&message));
  ddsi_serdata* data = nullptr;
  dds_sample_info_t info;
  ASSERT_EQ(dds_takecdr(reader->handle(), &data, 1, &info, DDS_ANY_STATE), 1);
  std::vector<std::byte> bytes(ddsi_serdata_size(data));
  ddsi_serdata_to_ser(data, 0, bytes.size(), bytes.data());
  ddsi_serdata_unref(data);
  EXPECT_EQ(
      to_hex(bytes),
      to_hex(from_hex(
          "00010000"                                            // CDR, little-endian
          "04030201 08070605"                                   // stamp
          "04000000 6d617000"                                   // "map" with its zero
          "000000000000f03f 00000000000000c0 000000000000d03f"  // x y z
          "000000000000e03f 000000000000e0bf 000000000000e03f 000000000000e0bf")));  // x y z w
}

TEST_F(DdsWire, WritersAnnounceRosNamesAndTheTypeHash) {
  const auto topic = ros_topic("/tf", RosType::kTfMessage);
  EXPECT_EQ(topic.name, "rt/tf");
  EXPECT_STREQ(topic.type->m_typename, "tf2_msgs::msg::dds_::TFMessage_");
  auto writer = Writer::make(*participant_, topic, {true, true, 1, 0});
  ASSERT_TRUE(writer);
  dds_qos_t* qos = dds_create_qos();
  ASSERT_EQ(dds_get_qos(writer->handle(), qos), DDS_RETCODE_OK);
  void* data = nullptr;
  std::size_t size = 0;
  ASSERT_TRUE(dds_qget_userdata(qos, &data, &size));
  EXPECT_EQ(std::string(static_cast<char*>(data), size),
            "typehash=RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087;");
  dds_free(data);
  dds_delete_qos(qos);
}

TEST_F(DdsWire, TypesHaveTheMangledNamesOfRos) {
  const std::pair<RosType, const char*> expected[] = {
      {RosType::kPoseStamped, "geometry_msgs::msg::dds_::PoseStamped_"},
      {RosType::kTwistStamped, "geometry_msgs::msg::dds_::TwistStamped_"},
      {RosType::kOdometry, "nav_msgs::msg::dds_::Odometry_"},
      {RosType::kNamedPoseArray, "motion_capture_tracking_interfaces::msg::dds_::NamedPoseArray_"},
      {RosType::kRigidBodies, "mocap4r2_msgs::msg::dds_::RigidBodies_"},
      {RosType::kDiagnosticArray, "diagnostic_msgs::msg::dds_::DiagnosticArray_"},
      {RosType::kVehicleOdometry, "px4_msgs::msg::dds_::VehicleOdometry_"},
  };
  for (const auto& [type, name] : expected)
    EXPECT_STREQ(ros_topic("/x", type).type->m_typename, name);
}

}  // namespace
}  // namespace fiducap::dds
