#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "fiducap/v1/envelope.pb.h"
#include "streaming/native/frames.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::native {
namespace {

TEST(Profile, OmitsAConstantNumberOfFramesToLimitTheRate) {
  Profile profile;
  EXPECT_EQ(step_of(profile, 200), 1u) << "no limit";
  for (const auto& [most, step] : std::vector<std::pair<float, std::uint64_t>>{
           {200, 1}, {1000, 1}, {199, 2}, {100, 2}, {99, 3}, {50, 4}, {1, 200}, {0.1F, 2000}}) {
    profile.max_rate_hz = most;
    EXPECT_EQ(step_of(profile, 200), step) << most << " Hz";
  }
  profile.max_rate_hz = 100;
  EXPECT_EQ(step_of(profile, 200.0001), 2u) << "a clock's error does not cost a frame";
  EXPECT_EQ(step_of(profile, 0), 1u) << "a server without a rate";
}

TEST(Profile, ChoosesBodiesByNameInTheOrderOfTheScene) {
  const SceneModel model{1, {{1, "c"}, {2, "a"}, {3, "b"}}};
  Profile profile;
  EXPECT_EQ(chosen_bodies(profile, model), (std::vector<std::uint32_t>{0, 1, 2}));
  profile.bodies = {"b", "c", "ghost"};
  EXPECT_EQ(chosen_bodies(profile, model), (std::vector<std::uint32_t>{0, 2}));
  profile.bodies = {"ghost"};
  EXPECT_TRUE(chosen_bodies(profile, model).empty());
}

TEST(ProfileTable, NumbersAreBoundedAndNeverUsedTwice) {
  ProfileTable table;
  Profile profile;
  EXPECT_EQ(table.grant(profile), 0u);
  for (std::size_t i = 1; i <= ProfileTable::kMost; ++i) {
    profile.max_rate_hz = static_cast<float>(i);
    EXPECT_EQ(table.grant(profile), i);
    EXPECT_EQ(table.grant(profile), i) << "the same profile";
  }
  profile.covariance = false;
  EXPECT_FALSE(table.grant(profile));
  table.prune([](std::uint32_t number) { return number != 3; });
  EXPECT_EQ(table.grant(profile), ProfileTable::kMost + 1);
}

constexpr std::uint64_t kSession = 0x2122232425262728;

v1::Frame frame_of(std::span<const std::byte> datagram) {
  v1::Envelope envelope;
  EXPECT_TRUE(envelope.ParseFromArray(datagram.data(), static_cast<int>(datagram.size())));
  EXPECT_EQ(envelope.protocol(), kProtocol);
  EXPECT_TRUE(envelope.has_frame());
  return envelope.frame();
}
/// The first datagram with the default profile.
v1::Frame encoded(const SceneFrame& frame) {
  FrameEncoder encoder(kSession);
  return frame_of(encoder.encode(frame)[0]);
}

TEST(FrameEncoder, MatchesTheBytes) {
  // Every number is different and exact in binary; (2, 4, 5, 6)/9 is a unit quaternion.
  const auto frame = make_scene_frame({"drone"}, 7);
  frame->at = instant_from_ns(0x0102030405060708);
  frame->published_at = instant_from_ns(0x1112131415161718);
  frame->utc_offset = Duration{0x3132333435363738};
  BodyPose& body = frame->bodies[0];
  body.X_WP = {{2 / 9., 4 / 9., 5 / 9., 6 / 9.}, {1.0, -2.0, 0.25}};
  body.w_WP_P = {1, 2, 4};
  body.covariance.setZero();
  body.covariance.diagonal() << 1, 4, 2, 0.25, 0.0625, 0.125, 9, 9, 9, 9, 9, 9;
  body.covariance(0, 5) = body.covariance(5, 0) = -1;
  body.age = Duration{20};
  FrameEncoder encoder(kSession);
  const auto datagrams = encoder.encode(*frame);
  ASSERT_EQ(datagrams.size(), 1u);
  const std::vector<std::byte> bytes(datagrams[0].begin(), datagrams[0].end());
  EXPECT_EQ(
      to_hex(bytes),
      to_hex(from_hex(
          "0d 46444331 3a 8f02"                      // Frame, 271 bytes
          "09 2827262524232221 10 07 20 01 30 01"    // session, number, part and body_count
          "39 0807060504030201 41 1817161514131211"  // at, published_at
          "49 3837363534333231 55 0000c842 60 01"    // utc_offset, rate, model_generation
          "6a db01 08 01 10 01 18 01"                // Body, 219 bytes: id, tracking, valid
          "22 1b 09 000000000000f03f 11 00000000000000c0 19 000000000000d03f"
          "2a 24 09 1cc7711cc771cc3f 11 1cc7711cc771dc3f 19 721cc7711cc7e13f 21 555555555555e53f"
          "32 0f 0d 0000003f 15 000080be 1d 0000003e"  // velocity
          "3a 0f 0d 0000803f 15 00000040 1d 00008040"  // body rate
          "42 00"                                      // acceleration zero
          "4d 00000040"                                // position sigma: sqrt(4)
          "55 0000003f"                                // rotation sigma: sqrt(0.25)
          "5a 54 0000803f 00000000 00000000 00000000 00000000 000080bf"
          "      00008040 00000000 00000000 00000000 00000000"
          "      00000040 00000000 00000000 00000000"
          "      0000803e 00000000 00000000"
          "      0000803d 00000000"
          "      0000003e"
          "60 14"            // age 20 ns
          "68 03"            // tags in view
          "75 00004040"      // velocity sigma: sqrt(9)
          "7d 00004040")));  // rate sigma
}

TEST(FrameEncoder, SendsNoPoseOfAnInvalidBody) {
  const auto frame = make_scene_frame({"a", "b"});
  frame->bodies[1].valid = false;
  frame->bodies[1].state = BodyState::kLost;
  const auto message = encoded(*frame);
  ASSERT_EQ(message.bodies_size(), 2);
  const auto& lost = message.bodies(1);
  EXPECT_EQ(lost.state(), v1::Body::STATE_LOST);
  EXPECT_FALSE(lost.valid() || lost.has_position() || lost.has_orientation() ||
               lost.has_velocity());
  EXPECT_EQ(lost.pose_covariance_size(), 0);
  EXPECT_EQ(lost.age_ns(), 20'000'000);
}

TEST(FrameEncoder, SendsNoPoseWithNumbersThatAreNotFinite) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
    const auto frame = make_scene_frame({"a", "b", "c"});
    frame->bodies[0].X_WP.p.y() = bad;
    frame->bodies[1].w_WP_P.z() = bad;
    frame->bodies[2].covariance(2, 3) = bad;
    const auto message = encoded(*frame);
    for (const auto& body : message.bodies()) EXPECT_FALSE(body.valid()) << bad;
  }
}

TEST(FrameEncoder, SplitsALargeSceneWithoutGaps) {
  for (const int count : {0, 1, 4, 5, 6, 100, static_cast<int>(kMaxBodies)}) {
    const auto frame = make_scene_frame(numbered_names(count));
    for (auto& body : frame->bodies) body.age = Duration{-4'000'000'000'000};  // longest encoding
    FrameEncoder encoder(kSession);
    const auto datagrams = encoder.encode(*frame);
    ASSERT_LE(datagrams.size(), kMaxParts);
    std::uint32_t next_body = 0;
    for (std::size_t i = 0; i < datagrams.size(); ++i) {
      ASSERT_LE(datagrams[i].size(), kMaxDatagram);
      const auto message = frame_of(datagrams[i]);
      EXPECT_EQ(message.part_index(), i);
      EXPECT_EQ(message.part_count(), datagrams.size());
      EXPECT_EQ(message.first_body(), next_body);
      EXPECT_EQ(message.body_count(), static_cast<std::uint32_t>(count));
      for (const auto& body : message.bodies()) EXPECT_EQ(body.id(), ++next_body);
    }
    EXPECT_EQ(next_body, static_cast<std::uint32_t>(count));
  }
}

TEST(FrameEncoder, AllocatesNothingAfterWarmUp) {
  const auto big = make_scene_frame(numbered_names(100));
  const auto small = make_scene_frame({"a"});
  FrameEncoder encoder(kSession);
  for (int i = 0; i < 3; ++i) (void)encoder.encode(*big);
  const AllocationCounter allocations;
  std::size_t sent = 0;
  for (int i = 0; i < 100; ++i) sent += encoder.encode(i % 2 == 0 ? *big : *small).size();
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_GT(sent, 100u);
}

TEST(FrameEncoder, ConvertsAxesUnitsSigmasAndCovariance) {
  const auto frame = make_scene_frame({"a"});
  BodyPose& body = frame->bodies[0];
  body.X_WP.p = {1, 2, 3};
  body.v_WP = {4, 5, 6};
  body.a_WP = {7, 8, 9};
  body.covariance.setZero();
  body.covariance.diagonal() << 1e-6, 4e-6, 9e-6, 1, 4, 9, 1e-6, 4e-6, 9e-6, 1, 1, 1;
  Profile profile;
  profile.axes = {UpAxis::kY, AxesScope::kWorld, 1000.0};
  FrameEncoder encoder(kSession, {5, profile});
  const auto message = frame_of(encoder.encode(*frame)[0]);
  EXPECT_EQ(message.profile(), 5u);
  const auto& out = message.bodies(0);
  EXPECT_EQ(out.position().x(), 1000);  // x' = x, y' = z, z' = -y, in mm
  EXPECT_EQ(out.position().y(), 3000);
  EXPECT_EQ(out.position().z(), -2000);
  EXPECT_EQ(out.velocity().y(), 6000);
  EXPECT_EQ(out.acceleration().z(), -8000);
  EXPECT_FLOAT_EQ(out.position_sigma(), 3);
  EXPECT_FLOAT_EQ(out.velocity_sigma(), 3);
  EXPECT_FLOAT_EQ(out.pose_covariance(0), 1);   // x'x' = xx in mm²
  EXPECT_FLOAT_EQ(out.pose_covariance(6), 9);   // y'y' = zz
  EXPECT_FLOAT_EQ(out.pose_covariance(15), 1);  // rotations stay in rad²
  EXPECT_FLOAT_EQ(out.pose_covariance(18), 9);
}

TEST(FrameEncoder, SendsTheChosenBodiesInTheirOrder) {
  const auto frame = make_scene_frame({"a", "b", "c", "d"});
  FrameEncoder encoder(kSession);
  const std::vector<std::uint32_t> chosen{1, 3};
  const auto message = frame_of(encoder.encode(*frame, chosen, 1)[0]);
  EXPECT_EQ(message.body_count(), 2u);
  ASSERT_EQ(message.bodies_size(), 2);
  EXPECT_EQ(message.bodies(0).id(), 2u);
  EXPECT_EQ(message.bodies(1).id(), 4u);
  EXPECT_EQ(message.step(), 0u) << "1 is not written";
}

TEST(FrameEncoder, OmitsTheCovarianceOnRequest) {
  const auto frame = make_scene_frame(numbered_names(40));
  Profile without;
  without.covariance = false;
  FrameEncoder lean(kSession, {1, without});
  FrameEncoder whole(kSession);
  const auto datagrams = lean.encode(*frame);
  const auto body = frame_of(datagrams[0]).bodies(0);
  EXPECT_EQ(body.pose_covariance_size(), 0);
  EXPECT_GT(body.position_sigma(), 0);
  EXPECT_LT(datagrams.size(), whole.encode(*frame).size());
}

TEST(FrameEncoder, FullPartWithTheLongestHeaderFitsADatagram) {
  const auto frame = make_scene_frame(numbered_names(1000), ~0ull / 1'000'000 * 1'000'000);
  frame->at = frame->published_at = instant_from_ns(-1);
  frame->utc_offset = Duration{-1};
  auto model = std::make_shared<SceneModel>(*frame->model);
  model->generation = ~0ull;
  frame->model = model;
  auto map = std::make_shared<TagMap>();
  map->version = -1;
  frame->map = map;
  for (bool covariance : {true, false}) {
    Profile profile;
    profile.covariance = covariance;
    FrameEncoder encoder(kSession, {0xffffffff, profile});
    std::vector<std::uint32_t> all(1000);
    std::iota(all.begin(), all.end(), 0u);
    for (const auto& datagram : encoder.encode(*frame, all, 1'000'000))
      EXPECT_LE(datagram.size(), kMaxDatagram);
  }
}

}  // namespace
}  // namespace fiducap::native
