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

// The middleware allocates for what it keeps; that is not counted. The linker puts this in its
// place (--wrap).
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
using testing::HasSubstr;
using testing::SizeIs;

TEST_F(DdsServerTest, PoseIsForTheInstantOfTheFrame) {
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

TEST_F(DdsServerTest, WhatMayNotBeUsedIsAbsentAndTheNativeTypeSaysWhy) {
  frame_->bodies[0].valid = false;
  frame_->bodies[0].state = BodyState::kLost;
  start({});
  auto pose = read("rt/big_drone/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  auto odometry = read("rt/big_drone/odom", nav_msgs_msg_dds__Odometry__desc);
  auto tf = read("rt/tf", tf2_msgs_msg_dds__TFMessage__desc);
  auto poses = read("rt/poses", motion_capture_tracking_interfaces_msg_dds__NamedPoseArray__desc);
  auto rigid = read("rt/rigid_bodies", mocap4r2_msgs_msg_dds__RigidBodies__desc);
  auto native = read("fiducap/bodies", fiducap_dds_Body_desc);
  publish();
  EXPECT_FALSE(pose.take());
  EXPECT_FALSE(odometry.take());
  const auto transforms = tf.take();
  ASSERT_TRUE(transforms);
  ASSERT_EQ(transforms.as<tf2_msgs_msg_dds__TFMessage_>().transforms._length, 1u);
  EXPECT_STREQ(transforms.as<tf2_msgs_msg_dds__TFMessage_>().transforms._buffer[0].child_frame_id,
               "rover");
  const auto named = poses.take();
  ASSERT_TRUE(named);
  EXPECT_EQ(named.as<motion_capture_tracking_interfaces_msg_dds__NamedPoseArray_>().poses._length,
            1u);
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

TEST_F(DdsServerTest, NamedPosesComeAlsoWithoutABodyForWhoAsksForADeadline) {
  for (auto& body : frame_->bodies) body.valid = false;
  start({});
  auto poses = read("rt/poses", motion_capture_tracking_interfaces_msg_dds__NamedPoseArray__desc,
                    {false, false, 10, 0.01});
  publish();
  const auto named = poses.take();
  ASSERT_TRUE(named);
  EXPECT_EQ(named.as<motion_capture_tracking_interfaces_msg_dds__NamedPoseArray_>().poses._length,
            0u);
}

TEST_F(DdsServerTest, LateJoinersGetTheMapAndItsSettledTagsAsFrames) {
  auto map = std::make_shared<TagMap>();
  for (const auto state :
       {TagState::kSurveyed, TagState::kLocal, TagState::kQuarantined, TagState::kCalibrated}) {
    MapTag tag;
    tag.tag.tag_id = static_cast<int>(map->tags.size()) * 10;
    tag.tag.edge_m = 0.2;
    tag.tag.X_WT = {Eigen::Quaterniond::Identity(), {static_cast<double>(tag.tag.tag_id), 0, 0}};
    tag.state = state;
    map->tags.push_back(tag);
  }
  frame_->map = map;
  start({});
  publish();
  publish();  // the same map: nothing new
  auto tf = read("rt/tf_static", tf2_msgs_msg_dds__TFMessage__desc, {true, true, 100, 0});
  auto tags = read("fiducap/tags", fiducap_dds_Tag_desc, {true, true, 1, 0});
  const auto transforms = tf.take();
  ASSERT_TRUE(transforms);
  ASSERT_EQ(transforms.as<tf2_msgs_msg_dds__TFMessage_>().transforms._length, 2u);
  EXPECT_STREQ(transforms.as<tf2_msgs_msg_dds__TFMessage_>().transforms._buffer[1].child_frame_id,
               "tag_30");
  EXPECT_FALSE(tf.take());
  int count = 0;
  while (tags.take()) ++count;
  EXPECT_EQ(count, 4);
}

TEST_F(DdsServerTest, StaticFramesAreSentWhenTheyChangeNotWhenTheRestOfTheMapDoes) {
  start({});
  auto tf = read("rt/tf_static", tf2_msgs_msg_dds__TFMessage__desc, {true, true, 100, 0});
  const auto publish_map = [this](const std::vector<TagState>& states) {
    auto map = std::make_shared<TagMap>();
    for (const auto state : states) {
      MapTag tag;
      tag.tag.tag_id = static_cast<int>(map->tags.size());
      tag.state = state;
      map->tags.push_back(tag);
    }
    frame_->at += 2s;  // the map is sent at most once a second
    frame_->map = map;
    publish();
  };
  publish_map({TagState::kLocal, TagState::kLocal});
  EXPECT_FALSE(tf.take()) << "nothing is settled yet";
  publish_map({TagState::kLocal, TagState::kCalibrated});
  EXPECT_TRUE(tf.take());
  publish_map({TagState::kLocal, TagState::kCalibrated, TagState::kLocal});
  EXPECT_FALSE(tf.take()) << "only the rest of the map changed";
  publish_map({TagState::kCalibrated, TagState::kCalibrated});
  EXPECT_TRUE(tf.take());
}

TEST_F(DdsServerTest, Px4HasANamespacePerVehicleWhenThereAreSeveralAndKeepsIt) {
  DdsConfig config;
  config.px4 = Px4Profile::kNed;
  start(config);
  auto several =
      read("rt/rover/fmu/in/vehicle_visual_odometry", px4_msgs_msg_dds__VehicleOdometry__desc);
  auto one = read("rt/fmu/in/vehicle_visual_odometry", px4_msgs_msg_dds__VehicleOdometry__desc);
  publish();
  EXPECT_TRUE(several.take());
  only_rover_is_left();
  publish();
  EXPECT_TRUE(several.take()) << "the other one was switched off: no reason to lose this one";
  EXPECT_FALSE(one.take());
}

TEST_F(DdsServerTest, Px4HasNoNamespaceForASingleVehicle) {
  frame_ = make_scene_frame({"rover"});
  DdsConfig config;
  config.px4 = Px4Profile::kNed;
  start(config);
  auto one = read("rt/fmu/in/vehicle_visual_odometry", px4_msgs_msg_dds__VehicleOdometry__desc);
  publish();
  EXPECT_TRUE(one.take());
}

TEST_F(DdsServerTest, DisposesOfARemovedBodyAndServesANewOne) {
  start({});
  auto native = read("fiducap/bodies", fiducap_dds_Body_desc);
  publish();
  while (native.take()) {
  }
  only_rover_is_left();
  auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  publish();
  EXPECT_TRUE(pose.take());
  const auto body = native.take();
  ASSERT_TRUE(body);
  EXPECT_EQ(body.as<fiducap_dds_Body>().id, 7);
}

TEST_F(DdsServerTest, ListsWhoListensToWhat) {
  start({});
  std::vector<ClientStatus> clients;
  server_->append_clients(clients);
  EXPECT_THAT(clients, SizeIs(0));
  {
    auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
    auto tf = read("rt/tf", tf2_msgs_msg_dds__TFMessage__desc);
    server_->append_clients(clients);
    publish();
    clients.clear();
    server_->append_clients(clients);
    ASSERT_THAT(clients, SizeIs(1));
    EXPECT_EQ(clients[0].protocol, "dds");
    EXPECT_EQ(clients[0].detail, "/rover/pose /tf");
    EXPECT_EQ(clients[0].frames_sent, 2u);
    only_rover_is_left();  // new writers of bodies count from zero
    publish();
    clients.clear();
    server_->append_clients(clients);
    ASSERT_THAT(clients, SizeIs(1));
    EXPECT_EQ(clients[0].frames_sent, 4u);
  }
  clients.clear();
  server_->append_clients(clients);
  EXPECT_THAT(clients, SizeIs(0));
}

TEST_F(DdsServerTest, AllocatesNothingOfItsOwnPerFrameAfterWarmUp) {
  DdsConfig config;
  config.px4 = Px4Profile::kFrd;
  start(config);
  auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  auto odometry = read("rt/rover/odom", nav_msgs_msg_dds__Odometry__desc);
  auto tf = read("rt/tf", tf2_msgs_msg_dds__TFMessage__desc);
  auto poses = read("rt/poses", motion_capture_tracking_interfaces_msg_dds__NamedPoseArray__desc);
  auto rigid = read("rt/rigid_bodies", mocap4r2_msgs_msg_dds__RigidBodies__desc);
  auto native = read("fiducap/bodies", fiducap_dds_Body_desc);
  auto diagnostics = read("rt/diagnostics", diagnostic_msgs_msg_dds__DiagnosticArray__desc);
  auto px4 =
      read("rt/rover/fmu/in/vehicle_visual_odometry", px4_msgs_msg_dds__VehicleOdometry__desc);
  for (int i = 0; i < 300; ++i) publish();
  auto frame = std::make_shared<SceneFrame>(*frame_);
  // The middleware's own threads are counted, too, and work now and then; what we do per frame is
  // in every round.
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
  EXPECT_EQ(messages, 100) << "it was not silent";  // as many as the reader keeps
}

TEST_F(DdsServerTest, AfterStopNothingIsWrittenAndNothingBreaks) {
  start({});
  auto pose = read("rt/rover/pose", geometry_msgs_msg_dds__PoseStamped__desc);
  server_->stop();
  publish();
  EXPECT_FALSE(pose.take());
}

TEST_F(DdsServerTest, TheDomainCannotBeEnteredTwiceAndAWrongInterfaceIsNamed) {
  start({});
  NetworkConfig network;
  network.domain = kTestDomain;
  auto again = Participant::open(network);
  ASSERT_FALSE(again);
  EXPECT_THAT(again.error().text(), HasSubstr("dds.domain"));
  network.domain = 43;
  network.interface = "nosuch7";
  const auto wrong = Participant::open(network);
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().text(), HasSubstr("nosuch7"));
}

}  // namespace
}  // namespace fiducap::dds
