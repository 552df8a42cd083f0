#include "streaming/native/codec.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "fiducap/v1/envelope.pb.h"
#include "support/hex.hpp"

namespace fiducap::native {
namespace {

// Every fixture is written by hand from the protobuf wire format (tag = field << 3 | type): made by
// us, no peer needed.
const std::string kProtocolHex = "0d 46444331 ";  // field 1, fixed32, "FDC1"

std::vector<std::byte> subscribe_bytes(std::size_t padding = 128) {
  std::string hex = kProtocolHex;
  std::string body =
      "09 0807060504030201"  // token
      "11 1817161514131211"  // nonce
      "18 02"                // model_generation 2
      "22 04 64656d6f"       // client_name "demo"
      "28 64"                // frames_received 100
      "30 03";               // frames_lost 3
  for (std::size_t i = 0; i < padding; ++i) {
    if (i == 0)
      body += "3a " +
              to_hex({static_cast<std::byte>(0x80 | (padding & 0x7f)), std::byte(padding >> 7)});
    body += "00";
  }
  const std::size_t size = from_hex(body).size();
  hex += "12" + to_hex({static_cast<std::byte>(0x80 | (size & 0x7f)), std::byte(size >> 7)}) + body;
  return from_hex(hex);
}

TEST(NativeCodec, ReadsASubscribe) {
  const auto request = decode_request(subscribe_bytes());
  ASSERT_TRUE(request) << request.error().text();
  const auto& subscribe = std::get<SubscribeRequest>(*request);
  EXPECT_EQ(subscribe.token, 0x0102030405060708u);
  EXPECT_EQ(subscribe.nonce, 0x1112131415161718u);
  EXPECT_EQ(subscribe.model_generation, 2u);
  EXPECT_EQ(subscribe.client_name, "demo");
  EXPECT_EQ(subscribe.frames_lost, 3u);
}

TEST(NativeCodec, ReadsAnUnsubscribe) {
  const auto request = decode_request(from_hex(kProtocolHex + "2a 09 09 0807060504030201"));
  ASSERT_TRUE(request) << request.error().text();
  EXPECT_EQ(std::get<UnsubscribeRequest>(*request).token, 0x0102030405060708u);
}

TEST(NativeCodec, RefusesASubscribeThatIsNotPadded) {
  const auto request = decode_request(subscribe_bytes(64));
  ASSERT_FALSE(request);
  EXPECT_NE(request.error().what.find("padded to 128"), std::string::npos)
      << request.error().text();
}

TEST(NativeCodec, RefusesWhatOnlyAServerSends) {
  const auto request = decode_request(encode(ChallengeAnswer{1, 2, 3}));
  ASSERT_FALSE(request);
  EXPECT_EQ(request.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(request.error().what.find("Challenge"), std::string::npos) << request.error().text();
}

TEST(NativeCodec, RefusesAnotherProtocol) {
  auto bytes = subscribe_bytes();
  bytes[4] = std::byte{'2'};  // FDC2
  const auto request = decode_request(bytes);
  ASSERT_FALSE(request);
  EXPECT_EQ(request.error().code, ErrorCode::kUnsupported);
}

TEST(NativeCodec, RefusesALongDatagramAndALongName) {
  EXPECT_FALSE(decode_request(subscribe_bytes(1300)));
  v1::Envelope envelope;
  envelope.set_protocol(kProtocol);
  envelope.mutable_subscribe()->set_client_name(std::string(kMaxClientName + 1, 'x'));
  envelope.mutable_subscribe()->set_padding(std::string(kMinSubscribe, '\0'));
  const std::string text = envelope.SerializeAsString();
  EXPECT_FALSE(decode_request(std::as_bytes(std::span(text))));
}

TEST(NativeCodec, EveryTruncationIsAnError) {
  for (const auto& whole :
       {subscribe_bytes(), from_hex(kProtocolHex + "2a 09 09 0807060504030201")}) {
    for (std::size_t size = 0; size < whole.size(); ++size) {
      EXPECT_FALSE(decode_request(std::span(whole).first(size)))
          << size << " of " << whole.size() << " bytes";
    }
  }
}

TEST(NativeCodec, MutatedRequestsNeverBreakTheRules) {
  std::mt19937 random(7);  // NOLINT: the same bytes in every run
  const auto whole = subscribe_bytes();
  int accepted = 0;
  for (int i = 0; i < 20'000; ++i) {
    auto bytes = whole;
    for (unsigned changes = 1 + random() % 4; changes > 0; --changes) {
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    }
    const auto request = decode_request(bytes);
    if (!request) continue;
    ++accepted;
    if (const auto* subscribe = std::get_if<SubscribeRequest>(&*request)) {
      EXPECT_LE(subscribe->client_name.size(), kMaxClientName);
    }
  }
  EXPECT_GT(accepted, 0) << "changes in the padding alone must do no harm";
  EXPECT_LT(accepted, 20'000);
}

TEST(NativeCodec, ChallengeMatchesTheBytes) {
  EXPECT_EQ(encode(ChallengeAnswer{0x0102030405060708, 0x1112131415161718, 0x2122232425262728}),
            from_hex(kProtocolHex + "1a 1b"
                                    "09 0807060504030201"     // token
                                    "11 1817161514131211"     // nonce
                                    "19 2827262524232221"));  // session
}

TEST(NativeCodec, ChallengeIsShorterThanAnySubscribe) {
  EXPECT_LE(encode(ChallengeAnswer{~0ull, ~0ull, ~0ull}).size(), kMinSubscribe);
}

TEST(NativeCodec, LeaseMatchesTheBytes) {
  EXPECT_EQ(encode(LeaseAnswer{0x2122232425262728, 0x1112131415161718, 0x0102030405060708,
                               std::chrono::seconds(3), 2}),
            from_hex(kProtocolHex + "22 20"
                                    "09 2827262524232221"  // session
                                    "11 1817161514131211"  // nonce
                                    "19 0807060504030201"  // token
                                    "20 b817"              // lease_ms 3000
                                    "28 02"));             // model_generation
}

TEST(NativeCodec, NoticeMatchesTheBytes) {
  EXPECT_EQ(encode_notice(0x2122232425262728, 0, NoticeReason::kShuttingDown, "bye"),
            from_hex(kProtocolHex + "42 10 09 2827262524232221 18 03 22 03 627965"));
}

TEST(NativeCodec, ModelMatchesTheBytes) {
  const SceneModel model{2, {{1, "drone"}, {300, "arm"}}};
  const auto datagrams = encode_model(0x2122232425262728, model);
  ASSERT_EQ(datagrams.size(), 1u);
  EXPECT_EQ(datagrams[0],
            from_hex(kProtocolHex + "32 24"
                                    "09 2827262524232221"  // session
                                    "10 02"                // generation
                                    "20 01"  // part_count; part_index and first_body are 0
                                    "30 02"  // body_count
                                    "3a 09 08 01 12 05 64726f6e65"   // 1 "drone"
                                    "3a 08 08 ac02 12 03 61726d"));  // 300 "arm"
}

TEST(NativeCodec, AnEmptyModelIsOneDatagram) {
  EXPECT_EQ(encode_model(1, SceneModel{}).size(), 1u);
}

TEST(NativeCodec, ABigModelIsSplitWithoutGaps) {
  SceneModel model;
  for (int i = 0; i < static_cast<int>(kMaxBodies); ++i) {
    model.bodies.push_back({i + 1, std::to_string(i) + std::string(200, 'x')});
  }
  const auto datagrams = encode_model(1, model);
  std::set<std::uint32_t> ids;
  for (const auto& datagram : datagrams) {
    ASSERT_LE(datagram.size(), kMaxDatagram);
    v1::Envelope envelope;
    ASSERT_TRUE(envelope.ParseFromArray(datagram.data(), static_cast<int>(datagram.size())));
    EXPECT_EQ(envelope.model().part_count(), datagrams.size());
    EXPECT_EQ(envelope.model().first_body(), ids.size());
    for (const auto& body : envelope.model().bodies()) {
      EXPECT_EQ(body.name().size(), kMaxBodyName);
      ids.insert(body.id());
    }
  }
  EXPECT_EQ(ids.size(), kMaxBodies);
  EXPECT_LE(datagrams.size(), kMaxParts);
}

TEST(NativeCodec, ALongNameIsCutBetweenCharacters) {
  std::string name(kMaxBodyName - 1, 'x');
  name += "\xc3\xa4";  // ä, whose second byte no longer fits
  const auto datagrams = encode_model(1, SceneModel{1, {{1, name}}});
  v1::Envelope envelope;
  ASSERT_TRUE(envelope.ParseFromArray(datagrams[0].data(), static_cast<int>(datagrams[0].size())));
  EXPECT_EQ(envelope.model().bodies(0).name(), std::string(kMaxBodyName - 1, 'x'));
}

}  // namespace
}  // namespace fiducap::native
