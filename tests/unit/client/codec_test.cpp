#include "src/codec.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <random>

#include "fiducap/v1/envelope.pb.h"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"

namespace fiducap::sdk {
namespace {

using testing::ElementsAre;

// Written by hand from the protobuf wire format; the server's tests expect the same bytes from its
// encoder.
const std::string kProtocolHex = "0d 46444331 ";
const std::string kChallengeHex =
    kProtocolHex + "1a 1b 09 0807060504030201 11 1817161514131211 19 2827262524232221";
const std::string kLeaseHex =
    kProtocolHex +
    "22 20 09 2827262524232221 11 1817161514131211 19 0807060504030201 20 b817 28 02";
const std::string kNoticeHex = kProtocolHex + "42 10 09 2827262524232221 18 03 22 03 627965";
const std::string kModelHex = kProtocolHex +
                              "32 24 09 2827262524232221 10 02 20 01 30 02 3a 09 08 01 12 05 "
                              "64726f6e65 3a 08 08 ac02 12 03 61726d";
const std::string kFrameHex =
    kProtocolHex +
    "3a 8502 09 2827262524232221 10 07 20 01 30 01 39 0807060504030201 41 1817161514131211"
    "49 3837363534333231 55 0000c842 60 01 6a d101 08 01 10 01 18 01"
    "22 1b 09 000000000000f03f 11 00000000000000c0 19 000000000000d03f"
    "2a 24 09 1cc7711cc771cc3f 11 1cc7711cc771dc3f 19 721cc7711cc7e13f 21 555555555555e53f"
    "32 0f 0d 0000003f 15 000080be 1d 0000003e 3a 0f 0d 0000803f 15 00000040 1d 00008040 42 00"
    "4d 00000040 55 0000003f 5a 54"
    "0000803f 00000000 00000000 00000000 00000000 000080bf 00008040 00000000 00000000 00000000"
    "00000000 00000040 00000000 00000000 00000000 0000803e 00000000 00000000 0000803d 00000000"
    "0000003e 60 14 68 03";
const std::string kAllHex[]{kChallengeHex, kLeaseHex, kNoticeHex, kModelHex, kFrameHex};

class ClientCodec : public testing::Test {
 protected:
  MessageKind decode(const std::vector<std::byte>& bytes) {
    return decoder_.decode(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  }
  MessageKind decode(const v1::Envelope& envelope) {
    const std::string bytes = envelope.SerializeAsString();
    return decoder_.decode(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  }
  void expect_rules(MessageKind kind) const {
    if (kind == MessageKind::kFrame) {
      const FramePart& part = decoder_.frame();
      EXPECT_LE(part.place.first_body + part.frame.bodies.size(), part.place.body_count);
      EXPECT_LE(part.place.body_count, kMaxBodies);
      EXPECT_LT(part.place.index, part.place.count);
      for (const Body& body : part.frame.bodies) {
        double sum = 0;
        for (const double x : body.position_m) sum += x;
        for (const double x : body.orientation_wxyz) sum += x;
        EXPECT_EQ(std::isfinite(sum), body.valid) << "a pose is valid and finite, or neither";
      }
    } else if (kind == MessageKind::kModel) {
      EXPECT_LE(decoder_.model().place.first_body + decoder_.model().bodies.size(),
                decoder_.model().place.body_count);
    } else if (kind == MessageKind::kLease) {
      EXPECT_GT(decoder_.lease().lease, 0);
    }
  }

  Decoder decoder_;
};

TEST_F(ClientCodec, ReadsSmallMessages) {
  ASSERT_EQ(decode(from_hex(kChallengeHex)), MessageKind::kChallenge);
  EXPECT_THAT(decoder_.challenge(),
              testing::FieldsAre(0x0102030405060708u, 0x1112131415161718u, 0x2122232425262728u));
  ASSERT_EQ(decode(from_hex(kLeaseHex)), MessageKind::kLease);
  EXPECT_EQ(decoder_.lease().session, 0x2122232425262728u);
  EXPECT_EQ(decoder_.lease().token, 0x0102030405060708u);
  EXPECT_EQ(decoder_.lease().lease, 3 * kSecond);
  EXPECT_EQ(decoder_.lease().model_generation, 2u);
  ASSERT_EQ(decode(from_hex(kNoticeHex)), MessageKind::kNotice);
  EXPECT_TRUE(decoder_.notice().shutting_down);
  EXPECT_EQ(decoder_.notice().text, "bye");
  ASSERT_EQ(decode(from_hex(kModelHex)), MessageKind::kModel);
  EXPECT_EQ(decoder_.model().generation, 2u);
  ASSERT_EQ(decoder_.model().bodies.size(), 2u);
  EXPECT_EQ(decoder_.model().bodies[1], std::make_pair(300, std::string("arm")));
}

TEST_F(ClientCodec, ReadsAFrame) {
  ASSERT_EQ(decode(from_hex(kFrameHex)), MessageKind::kFrame);
  const Frame& frame = decoder_.frame().frame;
  EXPECT_EQ(frame.number, 7u);
  EXPECT_EQ(frame.at_server_ns, 0x0102030405060708);
  EXPECT_EQ(frame.at_utc_ns, 0x0102030405060708 + 0x3132333435363738);
  EXPECT_EQ(frame.published_server_ns, 0x1112131415161718);
  EXPECT_EQ(frame.rate_hz, 100.0);
  ASSERT_EQ(frame.bodies.size(), 1u);
  const Body& body = frame.bodies[0];
  EXPECT_EQ(body.id, 1);
  EXPECT_EQ(body.tracking, Tracking::kTracking);
  EXPECT_TRUE(body.valid);
  EXPECT_THAT(body.position_m, ElementsAre(1.0, -2.0, 0.25));
  EXPECT_THAT(body.orientation_wxyz, ElementsAre(2 / 9., 4 / 9., 5 / 9., 6 / 9.));
  EXPECT_THAT(body.velocity_m_s, ElementsAre(0.5, -0.25, 0.125));
  EXPECT_THAT(body.body_rate_rad_s, ElementsAre(1, 2, 4));
  EXPECT_THAT(body.acceleration_m_s2, ElementsAre(0, 0, 0));
  EXPECT_EQ(body.position_sigma_m, 2.0);
  EXPECT_EQ(body.rotation_sigma_rad, 0.5);
  EXPECT_EQ(body.pose_covariance[0], 1.0f);
  EXPECT_EQ(body.pose_covariance[5], -1.0f);
  EXPECT_EQ(body.pose_covariance[6], 4.0f);
  EXPECT_EQ(body.pose_covariance[20], 0.125f);
  EXPECT_DOUBLE_EQ(body.age_s, 20e-9);
  EXPECT_EQ(body.tags_in_view, 3);
}

TEST_F(ClientCodec, RefusesEveryTruncation) {
  for (const auto& hex : kAllHex) {
    auto bytes = from_hex(hex);
    while (!bytes.empty()) {
      bytes.pop_back();
      EXPECT_EQ(decode(bytes), MessageKind::kNone) << bytes.size() << " bytes of " << hex;
    }
  }
}

TEST_F(ClientCodec, MutatedMessagesAreRefusedOrKeepTheRules) {
  std::mt19937 random(11);  // NOLINT: the same bytes in every run
  for (const auto& hex : kAllHex) {
    const auto whole = from_hex(hex);
    int refused = 0;
    for (int i = 0; i < 10'000; ++i) {
      auto bytes = whole;
      for (unsigned changes = 1 + random() % 4; changes > 0; --changes)
        bytes[random() % bytes.size()] = static_cast<std::byte>(random());
      const MessageKind kind = decode(bytes);
      refused += kind == MessageKind::kNone ? 1 : 0;
      expect_rules(kind);
    }
    EXPECT_GT(refused, 0) << hex;
  }
}

/// Changes of the frame `kFrameHex`.
class ClientCodecFrame : public ClientCodec {
 protected:
  ClientCodecFrame() {
    const auto bytes = from_hex(kFrameHex);
    EXPECT_TRUE(envelope_.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  }
  v1::Frame& frame() { return *envelope_.mutable_frame(); }
  v1::Body& body() { return *frame().mutable_bodies(0); }

  v1::Envelope envelope_;
};

TEST_F(ClientCodecFrame, InvalidBodyHasNoNumbers) {
  body().set_valid(false);  // but it carries a pose
  ASSERT_EQ(decode(envelope_), MessageKind::kFrame);
  const Body& decoded = decoder_.frame().frame.bodies[0];
  EXPECT_FALSE(decoded.valid);
  EXPECT_TRUE(std::isnan(decoded.position_m[0]));
  EXPECT_TRUE(std::isnan(decoded.orientation_wxyz[0]));
  EXPECT_TRUE(std::isnan(decoded.velocity_m_s[2]));
  EXPECT_TRUE(std::isnan(decoded.position_sigma_m));
  EXPECT_DOUBLE_EQ(decoded.age_s, 20e-9);
}

TEST_F(ClientCodecFrame, UnusablePosesAndPlacesAreRefused) {
  const v1::Envelope good = envelope_;
  const std::pair<const char*, std::function<void()>> kCases[]{
      {"no position", [&] { body().clear_position(); }},
      {"not a unit quaternion", [&] { body().mutable_orientation()->set_w(0.9); }},
      {"infinite velocity",
       [&] { body().mutable_velocity()->set_y(std::numeric_limits<float>::infinity()); }},
      {"first body outside", [&] { frame().set_first_body(1); }},
      {"part outside", [&] { frame().set_part_index(1); }},
      {"too many bodies", [&] { frame().set_body_count(kMaxBodies + 1); }}};
  for (const auto& [what, change] : kCases) {
    envelope_ = good;
    change();
    EXPECT_EQ(decode(envelope_), MessageKind::kNone) << what;
  }
  envelope_ = good;
  frame().set_body_count(kMaxBodies);
  EXPECT_EQ(decode(envelope_), MessageKind::kFrame);
}

TEST_F(ClientCodecFrame, StateOfALaterVersionIsLost) {
  body().set_state(static_cast<v1::Body::State>(17));
  ASSERT_EQ(decode(envelope_), MessageKind::kFrame);
  EXPECT_EQ(decoder_.frame().frame.bodies[0].tracking, Tracking::kLost);
}

TEST_F(ClientCodec, DecodingFramesAllocatesNothingAfterWarmUp) {
  const auto bytes = from_hex(kFrameHex);
  decode(bytes);
  const AllocationCounter allocations;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(decode(bytes), MessageKind::kFrame);
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_F(ClientCodec, SubscribeHasTheLeastSizeAndFitsADatagram) {
  SubscribeRequest request;
  EXPECT_GE(encode(request).size(), kMinSubscribe);
  request.token = request.nonce = request.model_generation = ~0ull;
  request.client_name = std::string(500, 'x');
  request.frames_received = request.frames_lost = ~0ull;
  request.clock_offset = request.clock_sigma = request.latency_p99 = -1;
  request.multicast = true;
  request.profile = {true, true, 99.5F, true,
                     std::vector<std::string>(32, std::string(28, 'b'))};  // 900 bytes of names
  EXPECT_LE(encode(request).size(), kMaxDatagram);
}

TEST_F(ClientCodec, UnsubscribeIsTheseBytes) {
  const auto bytes = encode_unsubscribe(0x0102030405060708);
  const auto* begin = reinterpret_cast<const std::byte*>(bytes.data());
  EXPECT_EQ(std::vector<std::byte>(begin, begin + bytes.size()),
            from_hex(kProtocolHex + "2a 09 09 0807060504030201"));
}

TEST_F(ClientCodec, ProtobufReadsAClockQuery) {
  const auto bytes = encode_clock_query(0x0102030405060708, 0x1112131415161718);
  v1::Envelope envelope;
  ASSERT_TRUE(envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  EXPECT_EQ(envelope.protocol(), 0x31434446u);
  EXPECT_EQ(envelope.clock_query().token(), 0x0102030405060708u);
  EXPECT_EQ(envelope.clock_query().number(), 0x1112131415161718u);
  EXPECT_EQ(envelope.clock_query().padding().size(), 36u);
}

// Found by fuzzing: the difference of two such times overflows.
TEST_F(ClientCodec, RefusesImpossibleTimes) {
  v1::Envelope envelope;
  envelope.set_protocol(0x31434446);
  auto& reply = *envelope.mutable_clock_reply();
  reply.set_session(7);
  EXPECT_EQ(decode(envelope), MessageKind::kClockReply);
  reply.set_sent_at_ns(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(decode(envelope), MessageKind::kNone);
  auto& frame = *envelope.mutable_frame();
  frame.set_session(7);
  frame.set_number(1);
  frame.set_model_generation(1);
  frame.set_part_count(1);
  EXPECT_EQ(decode(envelope), MessageKind::kFrame);
  frame.set_at_ns(std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(decode(envelope), MessageKind::kNone);
}

TEST_F(ClientCodec, SurvivesEachFailedAllocation) {
  SubscribeRequest request;
  request.client_name = std::string(40, 'c');
  request.profile.bodies = {std::string(40, 'b')};
  fail_each_allocation([&] { (void)encode(request); });
  fail_each_allocation([] { (void)encode_unsubscribe(1); });
  fail_each_allocation([] { (void)encode_discovery_query(1); });
}

}  // namespace
}  // namespace fiducap::sdk
