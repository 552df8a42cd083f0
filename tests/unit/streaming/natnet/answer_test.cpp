#include "streaming/natnet/answer.hpp"

#include <gtest/gtest.h>

#include "messages.hpp"
#include "support/hex.hpp"

namespace fiducap::natnet {
namespace {

const ServerInfo kInfo{{2, 1, 0, 7}, {3, 1}, 1511, true, {239, 255, 42, 99}};

std::string name_field() { return "46696475636170" + std::string(2 * (256 - 7), '0'); }

TEST(Answer, ServerInfoByteForByte) {
  EXPECT_EQ(to_hex(encode(kInfo)), to_hex(from_hex("0100 1701" + name_field() +
                                                   "02010007"            // application
                                                   "03010000"            // bitstream
                                                   "8096980000000000"    // 10 MHz
                                                   "e705 01 efff2a63")));  // port, multicast, group
}

TEST(Answer, ServerInfoBeforeThreeEndsWithTheVersion) {
  ServerInfo info = kInfo;
  info.bitstream = {2, 10};
  EXPECT_EQ(to_hex(encode(info)), to_hex(from_hex("0100 0801" + name_field() + "02010007 020a0000")));
}

TEST(Answer, EchoCountsTicksOfTheFrames) {
  EXPECT_EQ(to_hex(encode_echo(278554190, instant_from_ns(123'456'789'000))),
            to_hex(from_hex("0d00 1000 4e669a1000000000 870dd649 00000000")));
}

// The answers of a commercial server, 3.0: 120 Hz, and 0 analog samples.
TEST(Answer, NumbersAreFourBytes) {
  EXPECT_EQ(encode_response(120.0F), from_hex("03000400 0000f042"));
  EXPECT_EQ(encode_response(std::int32_t{0}), from_hex("03000400 00000000"));
}

TEST(Answer, TextEndsWithNulAndFitsTheClientsBuffer) {
  EXPECT_EQ(encode_text_response("/"), from_hex("03000200 2f00"));
  const auto longest = encode_text_response(std::string(70000, 'x'));
  EXPECT_EQ(longest.size(), kHeaderSize + 256);
  EXPECT_EQ(longest.back(), std::byte{0});
}

TEST(Answer, TheBitstreamHasNoNul) {
  EXPECT_EQ(encode_bitstream_response({3, 1}), from_hex("03000f00 42697473747265616d2c332e312e30"));
}

TEST(Answer, UnrecognizedIsOneHundred) { EXPECT_EQ(encode_unrecognized(), from_hex("6400 0000")); }

}  // namespace
}  // namespace fiducap::natnet
