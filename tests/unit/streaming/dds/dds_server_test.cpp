// Written and read through the middleware, in one process.
#include "dds_server_fixture.hpp"

#include <dds/dds.h>
#include <fiducap_dds/fiducap.h>
#include <fiducap_dds/ros_geometry.h>
#include <fiducap_dds/ros_mocap.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>

#include "base/log.hpp"
#include "support/allocation_counter.hpp"

// Does not count allocations of the middleware; the linker replaces dds_write by it (--wrap).
extern "C" dds_return_t __real_dds_write(dds_entity_t writer, const void* data);
extern "C" dds_return_t __wrap_dds_write(dds_entity_t writer, const void* data) {
  const auto before = fiducap::g_allocations.load();
  const auto result = __real_dds_write(writer, data);
  fiducap::g_allocations.store(before);
  return result;
}

namespace fiducap::dds {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

using Poses = motion_capture_tracking_interfaces_msg_dds__NamedPoseArray_;
const auto& kPoses = motion_capture_tracking_interfaces_msg_dds__NamedPoseArray__desc;
const std::string kPx4Topic = "/fmu/in/vehicle_visual_odometry";

/// Tags in these states, with ids from 0.
std::shared_ptr<TagMap> map_of(const std::vector<TagState>& states) {
  auto map = std::make_shared<TagMap>();
  for (const auto state : states) {
    MapTag tag;
    tag.tag.tag_id = static_cast<int>(map->tags.size());
    tag.tag.edge_m = 0.2;
    tag.state = state;
    map->tags.push_back(tag);
  }
  return map;
}

/// The child frames of the next message.
std::vector<std::string> children(Reader& reader) {
  std::vector<std::string> all;
  if (const auto loan = reader.take()) {
    const auto& transforms = loan.as<tf2_msgs_msg_dds__TFMessage_>().transforms;
    for (std::uint32_t i = 0; i < transforms._length; ++i)
      all.emplace_back(transforms._buffer[i].child_frame_id);
  }
  return all;
}

TEST_F(DdsServerTest, PoseHasTheStampOfTheFrame) {
  start({});
  auto reader = read("rt/big_drone/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  publish();
  const auto loan = reader.take();
  ASSERT_TRUE(loan);
  const auto& pose = loan.as<geometry_msgs_msg_dds__PoseStamped_>();
  EXPECT_STREQ(pose.header.frame_id, "world");
  EXPECT_EQ(pose.header.stamp.sec, frame_->utc_ns() / 1'000'000'000);
  EXPECT_EQ(pose.header.stamp.nanosec, frame_->utc_ns() % 1'000'000'000);
  EXPECT_EQ(pose.pose.position.x, frame_->bodies[0].X_WP.p.x());
  EXPECT_FALSE(reader.take());
}

TEST_F(DdsServerTest, OmitsAnInvalidBodyExceptInTheNativeType) {
  frame_->bodies[0].valid = false;
  frame_->bodies[0].state = BodyState::kLost;
  start({});
  auto pose = read("rt/big_drone/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  auto odometry = read("rt/big_drone/odom", nav_msgs_msg_dds__Odometry__desc);
  auto tf = read("rt/tf", tf2_msgs_msg_dds__TFMessage__desc);
  auto poses = read("rt/poses", kPoses);
  auto rigid = read("rt/rigid_bodies", mocap4r2_msgs_msg_dds__RigidBodies__desc);
  auto native = read("fiducap/bodies", fiducap_dds_Body_desc);
  publish();
  EXPECT_FALSE(pose.take());
  EXPECT_FALSE(odometry.take());
  EXPECT_THAT(children(tf), ElementsAre("rover"));
  const auto named = poses.take();
  ASSERT_TRUE(named);
  EXPECT_EQ(named.as<Poses>().poses._length, 1u);
  const auto bodies = rigid.take();
  ASSERT_TRUE(bodies);
  EXPECT_EQ(bodies.as<mocap4r2_msgs_msg_dds__RigidBodies_>().rigidbodies._length, 1u);
  int lost = 0;
  for (int i = 0; i < 2; ++i) {
    const auto body = native.take();
    ASSERT_TRUE(body);
    const auto& message = body.as<fiducap_dds_Body>();
    if (message.id != 1) continue;
    ++lost;
    EXPECT_STREQ(message.name, "big-drone");
    EXPECT_FALSE(message.valid);
    EXPECT_EQ(message.state, fiducap_dds_LOST);
  }
  EXPECT_EQ(lost, 1);
}

TEST_F(DdsServerTest, SendsNamedPosesWithoutABodyWithinTheDeadline) {
  for (auto& body : frame_->bodies) body.valid = false;
  start({});
  auto poses = read("rt/poses", kPoses, {false, false, 10, 0.01});
  publish();
  const auto named = poses.take();
  ASSERT_TRUE(named);
  EXPECT_EQ(named.as<Poses>().poses._length, 0u);
}

TEST_F(DdsServerTest, LateReadersGetTheMapAndItsSettledTagsAsFrames) {
  using enum TagState;
  frame_->map = map_of({kSurveyed, kLocal, kQuarantined, kCalibrated});
  start({});
  publish(2);  // the same map: sent once
  auto tf = read("rt/tf_static", tf2_msgs_msg_dds__TFMessage__desc, {true, true, 100, 0});
  auto tags = read("fiducap/tags", fiducap_dds_Tag_desc, {true, true, 1, 0});
  EXPECT_THAT(children(tf), ElementsAre("tag_0", "tag_3"));
  EXPECT_FALSE(tf.take());
  int count = 0;
  while (tags.take()) ++count;
  EXPECT_EQ(count, 4);
}

TEST_F(DdsServerTest, SendsStaticFramesWhenSettledTagsChange) {
  using enum TagState;
  start({});
  auto tf = read("rt/tf_static", tf2_msgs_msg_dds__TFMessage__desc, {true, true, 100, 0});
  const auto is_sent = [&](const std::vector<TagState>& states) {
    frame_->at += 2s;  // the map is sent at most once a second
    frame_->map = map_of(states);
    publish();
    return static_cast<bool>(tf.take());
  };
  EXPECT_FALSE(is_sent({kLocal, kLocal})) << "no tag is settled";
  EXPECT_TRUE(is_sent({kLocal, kCalibrated}));
  EXPECT_FALSE(is_sent({kLocal, kCalibrated, kLocal})) << "another tag";
  EXPECT_TRUE(is_sent({kCalibrated, kCalibrated}));
}

TEST_F(DdsServerTest, Px4KeepsItsNamespaceOfSeveralVehicles) {
  start_px4(Px4Profile::kNed);
  auto several = read("rt/rover" + kPx4Topic, px4_msgs_msg_dds__VehicleOdometry__desc);
  auto one = read("rt" + kPx4Topic, px4_msgs_msg_dds__VehicleOdometry__desc);
  publish();
  EXPECT_TRUE(several.take());
  only_rover_is_left();
  publish();
  EXPECT_TRUE(several.take());
  EXPECT_FALSE(one.take());
}

TEST_F(DdsServerTest, Px4HasNoNamespaceForASingleVehicle) {
  frame_ = make_scene_frame({"rover"});
  start_px4(Px4Profile::kNed);
  auto one = read("rt" + kPx4Topic, px4_msgs_msg_dds__VehicleOdometry__desc);
  publish();
  EXPECT_TRUE(one.take());
}

TEST_F(DdsServerTest, RemovesABodyAndAddsAnother) {
  start({});
  auto native = read("fiducap/bodies", fiducap_dds_Body_desc);
  publish();
  while (native.take()) continue;
  only_rover_is_left();
  auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  publish();
  EXPECT_TRUE(pose.take());
  const auto body = native.take();
  ASSERT_TRUE(body);
  EXPECT_EQ(body.as<fiducap_dds_Body>().id, 7);
}

TEST_F(DdsServerTest, ListsReadersWithTheirTopics) {
  start({});
  EXPECT_THAT(clients(), IsEmpty());
  {
    auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
    auto tf = read("rt/tf", tf2_msgs_msg_dds__TFMessage__desc);
    (void)clients();
    publish();
    const auto listed = clients();
    ASSERT_THAT(listed, SizeIs(1));
    EXPECT_EQ(listed[0].protocol, "dds");
    EXPECT_EQ(listed[0].detail, "/rover/pose /tf");
    EXPECT_EQ(listed[0].frames_sent, 2u);
    only_rover_is_left();  // new writers of bodies count from zero
    publish();
    ASSERT_THAT(clients(), SizeIs(1));
    EXPECT_EQ(clients()[0].frames_sent, 4u);
  }
  EXPECT_THAT(clients(), IsEmpty());
}

TEST_F(DdsServerTest, AllocatesNothingPerFrameAfterWarmUp) {
  start_px4(Px4Profile::kFrd);
  auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  auto odometry = read("rt/rover/odom", nav_msgs_msg_dds__Odometry__desc);
  auto tf = read("rt/tf", tf2_msgs_msg_dds__TFMessage__desc);
  auto poses = read("rt/poses", kPoses);
  auto rigid = read("rt/rigid_bodies", mocap4r2_msgs_msg_dds__RigidBodies__desc);
  auto native = read("fiducap/bodies", fiducap_dds_Body_desc);
  auto diagnostics = read("rt/diagnostics", diagnostic_msgs_msg_dds__DiagnosticArray__desc);
  auto px4 = read("rt/rover" + kPx4Topic, px4_msgs_msg_dds__VehicleOdometry__desc);
  publish(300);
  auto frame = std::make_shared<SceneFrame>(*frame_);
  // Threads of the middleware are counted in some rounds, the server's work in all.
  std::uint64_t fewest = std::numeric_limits<std::uint64_t>::max();
  for (int round = 0; round < 10; ++round) {
    log::flush(std::chrono::seconds(10));  // its thread allocates, too
    const AllocationCounter counter;
    for (int i = 0; i < 60; ++i) {
      frame->at += 10ms;
      server_->publish(frame);
    }
    fewest = std::min(fewest, counter.count());
  }
  EXPECT_EQ(fewest, 0u);
  int messages = 0;
  while (odometry.take()) ++messages;
  EXPECT_EQ(messages, 100);  // as many as the reader keeps
}

TEST_F(DdsServerTest, PublishesNothingAfterStop) {
  start({});
  auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  server_->stop();
  publish();
  EXPECT_FALSE(pose.take());
}

TEST_F(DdsServerTest, ErrorsNameDomainAndInterface) {
  start({});
  const auto again = Participant::open({.domain = kTestDomain, .peers = {}});
  ASSERT_FALSE(again);
  EXPECT_THAT(again.error().text(), HasSubstr("dds.domain"));
  const auto wrong = Participant::open({.domain = 43, .interface = "nosuch7", .peers = {}});
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().text(), HasSubstr("nosuch7"));
}

}  // namespace
}  // namespace fiducap::dds
