#include "streaming/natnet/frame_encoder.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <random>

#include "base/pose.hpp"
#include "messages.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {
namespace {

using testing::ElementsAre;
using testing::Field;

constexpr OutputAxes kZUp{UpAxis::kZ, AxesScope::kWorld, 1.0};
constexpr OutputAxes kYUp{UpAxis::kY, AxesScope::kWorldAndBody, 1.0};
constexpr float kFloatRounding = 1e-6F;  // metres and quaternion parts of order one as f32

/// One body whose numbers are exact in f32; made at 1 s, published at 1.25 s, sent at 1.5 s; the
/// epoch is 1.5 s earlier.
class FrameBytes : public testing::Test {
 protected:
  FrameBytes() {
    frame_.number = 0x12345;
    frame_.at = instant_from_ns(1'000'000'000);
    frame_.published_at = instant_from_ns(1'250'000'000);
    frame_.model = std::make_shared<SceneModel>(SceneModel{1, {{9, "arm"}}});
    BodyPose body;
    body.body_id = 9;
    body.valid = true;
    body.X_WP = {Eigen::Quaterniond(2 / 9., 4 / 9., 5 / 9., 6 / 9.), {1.0, -2.0, 0.25}};
    body.covariance = Matrix12d::Identity() * std::pow(2.0, -20);
    frame_.bodies = {body};
  }
  std::string bytes(Bitstream version) {
    FrameEncoder encoder(kZUp, WhenInvalid::kFlag, instant_from_ns(-500'000'000));
    encoder.load(frame_, instant_from_ns(1'500'000'000), FrameBits::kRecording);
    const auto out = encoder.encode({frame_layout(version)});
    return to_hex({out.begin(), out.end()});
  }

  SceneFrame frame_;
};

const std::string kNumber = "45230100";
const std::string kPose = "09000000 0000803f 000000c0 0000803e 398ee33e e4380e3f abaa2a3f 398e633e";
const std::string kError = "0000803a";
const std::string kValid = "0100";
const std::string kLatency = "0000003f";
const std::string kNoTimecode = "00000000 00000000";
const std::string kSeconds = "000000000000f83f";
const std::string kTicks = "8096980000000000 20bcbe0000000000 c0e1e40000000000";
const std::string kBits = "0100";
/// The tag at the end: the vendor's library 4.4 discards a frame without it.
const std::string kEnd = "00000000";
const std::string k0 = "00000000";

TEST_F(FrameBytes, EqualTheLayoutOfEachVersion) {
  const std::string kOneBody = k0 + k0 + "01000000" + kPose;
  struct Case {
    std::vector<Bitstream> versions;
    std::string what, size, fields;
  };
  const Case kCases[] = {
      {{{2, 5}}, "the oldest", "5000", kOneBody + k0 + kError + k0 + k0 + kLatency + kNoTimecode},
      {{{2, 6}},
       "validity, time and bits",
       "5800",
       kOneBody + k0 + kError + kValid + k0 + k0 + kLatency + kNoTimecode + "0000c03f" + kBits},
      {{{2, 7}, {2, 8}},
       "the time as double",
       "5c00",
       kOneBody + k0 + kError + kValid + k0 + k0 + kLatency + kNoTimecode + kSeconds + kBits},
      {{{2, 9}, {2, 10}},
       "force plates",
       "6000",
       kOneBody + k0 + kError + kValid + k0 + k0 + k0 + kLatency + kNoTimecode + kSeconds + kBits},
      {{{3, 0}, {3, 1}, {4, 0}},
       "stamps instead of the latency",
       "7400",
       kOneBody + kError + kValid + k0 + k0 + k0 + k0 + kNoTimecode + kSeconds + kTicks + kBits},
      {{{4, 1}, {4, 2}, {4, 3}, {4, 4}},
       "sizes of all sections",
       "a000",
       k0 + k0 + k0 + k0 + "01000000 26000000" + kPose + kError + kValid + k0 + k0 + k0 + k0 + k0 +
           k0 + k0 + k0 + k0 + k0 + kNoTimecode + kSeconds + kTicks + k0 + k0 + kBits}};
  for (const auto& [versions, what, size, fields] : kCases) {
    for (const Bitstream version : versions)
      EXPECT_EQ(bytes(version), to_hex(from_hex("0700" + size + kNumber + fields + kEnd)))
          << text_of(version) << ": " << what;
  }
}

class FrameEncoderTest : public testing::Test {
 protected:
  std::span<const std::byte> encoded(const FrameProfile& profile = {}, std::int16_t bits = 0) {
    encoder_.load(*frame_, frame_->at, bits);
    return encoder_.encode(profile);
  }

  std::vector<WireBody> bodies(const FrameProfile& profile = {}) {
    return bodies_in(encoded(profile));
  }

  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"a", "b", "c"});
  FrameEncoder encoder_{kYUp, WhenInvalid::kFlag, Instant{}};
};

TEST_F(FrameEncoderTest, FlagsALostBodyAndKeepsItsPlaceAndPose) {
  const auto before = bodies()[1];
  EXPECT_EQ(before.params, 1);
  EXPECT_GT(before.mean_error, 0);
  frame_->bodies[1].valid = false;
  frame_->bodies[1].X_WP.p = {77, 77, 77};  // a drifting prediction is not sent
  const auto after = bodies();
  ASSERT_EQ(after.size(), 3U);
  EXPECT_EQ(after[1].id, 2);
  EXPECT_EQ(after[1].params, 0);
  EXPECT_EQ(after[1].mean_error, 0);
  EXPECT_EQ(after[1].p[0], before.p[0]);
  EXPECT_EQ(after[2].params, 1);
  const auto oldest = encoded({FrameLayout::k2_5});
  LittleEndianReader in(oldest);
  in.bytes(16);
  EXPECT_EQ(in.i32(), 2) << "2.5 has no flag: the body is omitted";
}

TEST_F(FrameEncoderTest, SendsFiniteNumbersForInvalidBodies) {
  frame_->bodies[0].valid = false;
  const auto body = bodies()[0];
  EXPECT_EQ(body.params, 0);
  EXPECT_EQ(body.p[0], 0);
  EXPECT_EQ(body.q[3], 1);
  frame_->bodies[0].valid = true;
  frame_->bodies[0].X_WP.p.x() = std::numeric_limits<double>::quiet_NaN();
  frame_->bodies[1].covariance.setConstant(std::numeric_limits<double>::infinity());
  const auto all = bodies();
  EXPECT_EQ(all[0].params, 0);
  EXPECT_EQ(all[1].params, 1);
  for (const auto& one : all) {
    for (const float x : one.p) EXPECT_TRUE(std::isfinite(x));
    EXPECT_TRUE(std::isfinite(one.mean_error));
  }
}

TEST_F(FrameEncoderTest, HoldRepeatsAndStopOmitsALostBody) {
  encoder_ = FrameEncoder(kYUp, WhenInvalid::kHold, Instant{});
  const auto before = bodies()[1];
  frame_->bodies[1].valid = false;
  frame_->bodies[1].X_WP.p = {77, 77, 77};
  const auto held = bodies()[1];
  EXPECT_EQ(held.params, 1);
  EXPECT_EQ(held.p[0], before.p[0]);
  frame_->axes = 1;
  EXPECT_EQ(bodies()[1].params, 0) << "the held pose is in other axes";
  encoder_ = FrameEncoder(kYUp, WhenInvalid::kStop, Instant{});
  frame_->bodies[1].valid = false;
  EXPECT_THAT(bodies(), ElementsAre(Field(&WireBody::id, 1), Field(&WireBody::id, 3)));
}

// As ROS drivers read a y-up stream: position (x, -z, y), quaternion (x, -z, y, w).
TEST_F(FrameEncoderTest, ClientsDecodeThePoseOfTheYUpStream) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    const Pose X_WP{exp_so3({normal(random), normal(random), normal(random)}),
                    {normal(random), normal(random), normal(random)}};
    frame_->bodies[0].X_WP = X_WP;
    const auto body = bodies()[0];
    const Eigen::Vector3d p(body.p[0], -body.p[2], body.p[1]);
    const Eigen::Quaterniond q(body.q[3], body.q[0], -body.q[2], body.q[1]);
    EXPECT_LT((p - X_WP.p).norm(), 4 * kFloatRounding);
    EXPECT_LT(q.angularDistance(X_WP.q), 4 * kFloatRounding);
  }
}

TEST_F(FrameEncoderTest, BitsReportChanges) {
  EXPECT_EQ(bits_in(encoded({}, FrameBits::kModelChanged)), FrameBits::kModelChanged);
  EXPECT_EQ(bits_in(encoded({FrameLayout::k4_1, true}, 0)), FrameBits::kBitstreamChanged);
  EXPECT_EQ(bits_in(encoded({FrameLayout::k4_1, false}, 0)), 0);
}

TEST_F(FrameEncoderTest, StampsNeverDecrease) {
  frame_->published_at = frame_->at - std::chrono::seconds(1);
  encoder_.load(*frame_, frame_->at - std::chrono::seconds(2), 0);
  const auto frame = encoder_.encode({});
  LittleEndianReader in(frame.subspan(frame.size() - 30));
  const auto mid_exposure = in.i64(), received = in.i64(), sent = in.i64();
  EXPECT_LE(mid_exposure, received);
  EXPECT_LE(received, sent);
}

TEST_F(FrameEncoderTest, EncodesTheBodiesOfASelectionOnly) {
  Selection selection;
  selection.only_subscribed();
  selection.body(3, true);
  EXPECT_THAT(bodies({FrameLayout::k3_0, false, &selection}), ElementsAre(Field(&WireBody::id, 3)));
}

TEST_F(FrameEncoderTest, EqualProfilesShareTheirBytes) {
  Selection one;
  one.body(3, false);
  const Selection other = one;
  encoder_.load(*frame_, frame_->at, 0);
  EXPECT_EQ(encoder_.encode({}).data(), encoder_.encode({}).data());
  EXPECT_EQ(encoder_.encode({FrameLayout::k3_0, false, &one}).data(),
            encoder_.encode({FrameLayout::k3_0, false, &other}).data());
  EXPECT_NE(encoder_.encode({FrameLayout::k3_0, false, &one}).data(),
            encoder_.encode({FrameLayout::k4_1, false, &one}).data());
  EXPECT_NE(encoder_.encode({}).data(), encoder_.encode({FrameLayout::k4_1}).data());
}

TEST_F(FrameEncoderTest, AThousandBodiesFitOneDatagramInEveryLayout) {
  frame_ = make_scene_frame(std::vector<std::string>(36, "x"));
  EXPECT_EQ(encoded({FrameLayout::k3_0}).size(), 82 + 38 * 36U);
  EXPECT_EQ(encoded({FrameLayout::k4_1}).size(), 126 + 38 * 36U);
  frame_ = make_scene_frame(std::vector<std::string>(1000, "x"));
  for (const auto layout : {FrameLayout::k2_5, FrameLayout::k2_6, FrameLayout::k2_7,
                            FrameLayout::k2_9, FrameLayout::k3_0, FrameLayout::k4_1}) {
    const auto frame = encoded({layout});
    EXPECT_LE(frame.size(), kMaxDatagram);
    LittleEndianReader in(frame);
    in.u16();
    EXPECT_EQ(in.u16(), frame.size() - kHeaderSize);
  }
}

}  // namespace
}  // namespace fiducap::natnet
