#include "streaming/qualisys/codec.hpp"

#include <gtest/gtest.h>

#include "support/hex.hpp"

namespace fiducap::qualisys {
namespace {

constexpr auto kLittle = std::endian::little;
constexpr auto kBig = std::endian::big;

// The vendor's C++ SDK 1.28 sends `Version 1.28` in these bytes on the little-endian port.
constexpr char kVersionCommand[] = "15000000 01000000 56657273696f6e20312e323800";

TEST(QualisysCodec, ReadsWhatTheVendorsSdkSends) {
  const auto bytes = from_hex(kVersionCommand);
  const auto packet = decode_packet(kLittle, bytes);
  ASSERT_TRUE(packet && *packet);
  EXPECT_EQ((*packet)->type, PacketType::kCommand);
  EXPECT_EQ((*packet)->size, bytes.size());
  EXPECT_EQ(decode_text((*packet)->payload), "Version 1.28");
}

TEST(QualisysCodec, WaitsForTheRestOfEveryTruncation) {
  const auto bytes = from_hex(kVersionCommand);
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    const auto packet = decode_packet(kLittle, std::span(bytes).first(n));
    ASSERT_TRUE(packet) << n;
    EXPECT_FALSE(*packet) << n;
  }
}

TEST(QualisysCodec, TakesTextWithoutItsZero) {
  const auto bytes = from_hex("0000000b 00000001 4e6577");
  const auto packet = decode_packet(kBig, bytes);
  ASSERT_TRUE(packet && *packet);
  EXPECT_EQ(decode_text((*packet)->payload), "New");
}

TEST(QualisysCodec, RefusesSizesThatCannotBe) {
  EXPECT_FALSE(decode_packet(kLittle, from_hex("07000000 01000000")));
  EXPECT_FALSE(decode_packet(kLittle, from_hex("ffffffff 01000000")));
  EXPECT_FALSE(decode_packet(kLittle, from_hex("01000100 01000000")));  // one more than the limit
  EXPECT_TRUE(decode_packet(kLittle, from_hex("00000100 01000000")));
}

TEST(QualisysCodec, TextCarriesItsZeroInBothOrders) {
  std::vector<std::byte> out;
  encode_text(kLittle, PacketType::kError, "no", out);
  encode_text(kBig, PacketType::kXml, "<a/>", out);
  EXPECT_EQ(out, from_hex("0b000000 00000000 6e6f00 0000000d 00000002 3c612f3e00"));
}

TEST(QualisysCodec, EventsAreNineBytesAndNothingIsEight) {
  std::vector<std::byte> out;
  encode_event(kLittle, Event::kCaptureSaved, out);
  encode_no_more_data(kBig, out);
  EXPECT_EQ(out, from_hex("09000000 06000000 0d 00000008 00000004"));
}

TEST(QualisysCodec, DiscoveryIsReadInEitherByteOrder) {
  // As the SDK broadcasts it: port 4534 in network order.
  const auto little = decode_discover(from_hex("0a000000 07000000 11b6"));
  const auto big = decode_discover(from_hex("0000000a 00000007 11b6"));
  ASSERT_TRUE(little && big);
  EXPECT_EQ(*little, 4534);
  EXPECT_EQ(*big, 4534);
}

TEST(QualisysCodec, DiscoveryThatIsNoneIsRefused) {
  EXPECT_FALSE(decode_discover(from_hex("0a000000 07000000 11")));
  EXPECT_FALSE(decode_discover(from_hex("0a000000 07000000 11b600")));
  EXPECT_FALSE(decode_discover(from_hex("0a000000 01000000 11b6")));
  EXPECT_FALSE(
      decode_discover(from_hex("0a000000 07000000 0035")));  // nobody is asked to answer DNS
  EXPECT_FALSE(decode_discover({}));
}

TEST(QualisysCodec, DiscoveryAnswerEndsInTheBasePortInNetworkOrder) {
  std::vector<std::byte> out;
  encode_discover_answer("lab", 22222, out);
  EXPECT_EQ(out, from_hex("0e000000 01000000 6c616200 56ce"));
}

}  // namespace
}  // namespace fiducap::qualisys
