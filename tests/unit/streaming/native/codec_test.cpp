#include "streaming/native/codec.hpp"

#include <gmock/gmock.h>

#include <optional>
#include <set>

#include "fiducap/v1/control.pb.h"
#include "fiducap/v1/envelope.pb.h"
#include "streaming/native/control_codec.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"

namespace fiducap::native {
namespace {

using namespace std::chrono_literals;

// The expected bytes are written by hand from the protobuf wire format (tag = field << 3 | type).
const std::string kProtocolHex = "0d 46444331 ";  // field 1, fixed32, "FDC1"
const std::string kUnsubscribeHex = kProtocolHex + "2a 09 09 0807060504030201";

std::vector<std::byte> subscribe_bytes(std::size_t padding = 128) {
  const auto two_byte_varint = [](std::size_t value) {
    return to_hex({static_cast<std::byte>(0x80 | (value & 0x7f)), std::byte(value >> 7)});
  };
  // token, nonce, model_generation 2, client_name "demo", frames_received 100, frames_lost 3
  std::string body = "09 0807060504030201 11 1817161514131211 18 02 22 04 64656d6f 28 64 30 03 3a ";
  body += two_byte_varint(padding);
  for (std::size_t i = 0; i < padding; ++i) body += "00";
  return from_hex(kProtocolHex + "12" + two_byte_varint(from_hex(body).size()) + body);
}

v1::Envelope parse(std::span<const std::byte> datagram) {
  v1::Envelope envelope;
  EXPECT_TRUE(envelope.ParseFromArray(datagram.data(), static_cast<int>(datagram.size())));
  return envelope;
}

TEST(NativeCodec, SurvivesEachFailedAllocation) {
  fail_each_allocation([] { (void)decode_request(subscribe_bytes()); });
  fail_each_allocation([] { (void)decode_request(from_hex(kUnsubscribeHex)); });
  fail_each_allocation([] { (void)encode_challenge(1, 2, 3); });
  fail_each_allocation([] {
    (void)encode_discovery(1, 2, {std::string(40, 'h'), "0.1.0", 3, 100, 4});
  });
  SceneModel model;
  for (int id = 1; id <= 40; ++id) model.bodies.push_back({id, std::string(40, 'n')});
  fail_each_allocation([&] { (void)encode_model(1, model, 0); });
  v1::ControlCommand rename;
  rename.mutable_rename()->set_body_id(1);
  rename.mutable_rename()->set_name(std::string(40, 'n'));
  const std::string body = rename.SerializeAsString();
  fail_each_allocation([&] { (void)decode_control_command(body); });
}

TEST(NativeCodec, DecodesRequests) {
  const auto request = decode_request(subscribe_bytes());
  ASSERT_TRUE(request);
  const auto& subscribe = std::get<SubscribeRequest>(*request);
  EXPECT_EQ(subscribe.token, 0x0102030405060708u);
  EXPECT_EQ(subscribe.nonce, 0x1112131415161718u);
  EXPECT_EQ(subscribe.model_generation, 2u);
  EXPECT_EQ(subscribe.client_name, "demo");
  EXPECT_EQ(subscribe.report.frames_lost, 3u);
  const auto unsubscribe = decode_request(from_hex(kUnsubscribeHex));
  ASSERT_TRUE(unsubscribe);
  EXPECT_EQ(std::get<UnsubscribeRequest>(*unsubscribe).token, 0x0102030405060708u);
}

TEST(NativeCodec, RefusesWhatIsNoRequest) {
  EXPECT_FALSE(decode_request(subscribe_bytes(64)));
  EXPECT_FALSE(decode_request(encode_challenge(1, 2, 3)));
  auto other_protocol = subscribe_bytes();
  other_protocol[4] = std::byte{'2'};  // FDC2
  EXPECT_FALSE(decode_request(other_protocol));
  EXPECT_FALSE(decode_request(subscribe_bytes(1300)));
  v1::Envelope long_name;
  long_name.set_protocol(kProtocol);
  long_name.mutable_subscribe()->set_client_name(std::string(kMaxClientName + 1, 'x'));
  long_name.mutable_subscribe()->set_padding(std::string(kMinSubscribe, '\0'));
  const std::string text = long_name.SerializeAsString();
  EXPECT_FALSE(decode_request(std::as_bytes(std::span(text))));
}

TEST(NativeCodec, RefusesTruncatedRequests) {
  for (const auto& whole : {subscribe_bytes(), from_hex(kUnsubscribeHex)}) {
    for (std::size_t size = 0; size < whole.size(); ++size) {
      EXPECT_FALSE(decode_request(std::span(whole).first(size)))
          << size << " of " << whole.size() << " bytes";
    }
  }
}

TEST(NativeCodec, RepliesMatchTheBytes) {
  // token, nonce, session
  EXPECT_EQ(
      encode_challenge(0x0102030405060708, 0x1112131415161718, 0x2122232425262728),
      from_hex(kProtocolHex + "1a 1b 09 0807060504030201 11 1817161514131211 19 2827262524232221"));
  EXPECT_LE(encode_challenge(~0ull, ~0ull, ~0ull).size(), kMinSubscribe);
  // session, nonce, token, lease_ms 3000, model_generation
  EXPECT_EQ(
      encode(LeaseAnswer{0x2122232425262728, 0x1112131415161718, 0x0102030405060708, 3s, 2}),
      from_hex(kProtocolHex + "22 20 09 2827262524232221 11 1817161514131211 19 0807060504030201"
                              "20 b817 28 02"));
  EXPECT_EQ(encode_notice(0x2122232425262728, 0, NoticeReason::kShuttingDown, "bye"),
            from_hex(kProtocolHex + "42 10 09 2827262524232221 18 03 22 03 627965"));
}

TEST(NativeCodec, ModelMatchesTheBytes) {
  const SceneModel model{2, {{1, "drone"}, {300, "arm"}}};
  const auto datagrams = encode_model(0x2122232425262728, model);
  ASSERT_EQ(datagrams.size(), 1u);
  // session, generation, part_count, body_count (part_index and first_body are 0), 1 "drone",
  // 300 "arm"
  EXPECT_EQ(datagrams[0],
            from_hex(kProtocolHex + "32 24 09 2827262524232221 10 02 20 01 30 02"
                                    "3a 09 08 01 12 05 64726f6e65 3a 08 08 ac02 12 03 61726d"));
  EXPECT_EQ(encode_model(1, SceneModel{}).size(), 1u);
}

TEST(NativeCodec, LargeModelIsSplitWithoutGaps) {
  SceneModel model;
  for (int i = 0; i < static_cast<int>(kMaxBodies); ++i)
    model.bodies.push_back({i + 1, std::to_string(i) + std::string(200, 'x')});
  const auto datagrams = encode_model(1, model);
  std::set<std::uint32_t> ids;
  for (const auto& datagram : datagrams) {
    ASSERT_LE(datagram.size(), kMaxDatagram);
    const v1::Envelope envelope = parse(datagram);
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

TEST(NativeCodec, LongNameIsCutBetweenCharacters) {
  const std::string fits(kMaxBodyName - 1, 'x');
  const auto datagrams = encode_model(1, SceneModel{1, {{1, fits + "ä"}}});  // of two bytes
  EXPECT_EQ(parse(datagrams[0]).model().bodies(0).name(), fits);
}

}  // namespace
}  // namespace fiducap::native
