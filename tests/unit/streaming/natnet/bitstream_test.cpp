#include "streaming/natnet/bitstream.hpp"

#include <gtest/gtest.h>

namespace fiducap::natnet {
namespace {

constexpr Bitstream kDefault{3, 1};

TEST(Bitstream, ReadsTwoToFourParts) {
  EXPECT_EQ(parse_bitstream("3.1"), (Bitstream{3, 1}));
  EXPECT_EQ(parse_bitstream("2.10.0"), (Bitstream{2, 10}));
  EXPECT_EQ(parse_bitstream("4.1.7.9"), (Bitstream{4, 1}));
  EXPECT_EQ(parse_bitstream("255.255"), (Bitstream{255, 255}));
}

TEST(Bitstream, RefusesEveryOtherText) {
  for (const char* text : {"", "3", "3.", ".1", "3.1.", "3.1.0.0.0", "3.-1", "256.0", "3.1x", "x", " 3.1", "3..1", "1e1.0"}) {
    EXPECT_EQ(parse_bitstream(text), std::nullopt) << text;
  }
}

TEST(Bitstream, TwoTenComesAfterTwoNine) {
  EXPECT_LT((Bitstream{2, 9}), (Bitstream{2, 10}));
  EXPECT_EQ(frame_layout({2, 10}), FrameLayout::k2_9);
}

TEST(Bitstream, EverySupportedOneHasItsName) {
  for (const Bitstream version : kBitstreams) {
    EXPECT_TRUE(is_supported(version));
    EXPECT_EQ(parse_bitstream(text_of(version)), version);
  }
  EXPECT_FALSE(is_supported({4, 3}));
  EXPECT_FALSE(is_supported({2, 4}));
}

TEST(Negotiation, AClientThatDoesNotSayGetsTheDefault) { EXPECT_EQ(negotiate({}, kDefault), kDefault); }

TEST(Negotiation, AClientGetsWhatItWants) {
  EXPECT_EQ(negotiate({Bitstream{4, 2}, Bitstream{2, 7}}, kDefault), (Bitstream{2, 7}));
  EXPECT_EQ(negotiate({Bitstream{4, 2}, Bitstream{4, 2}}, kDefault), (Bitstream{4, 2}));
}

TEST(Negotiation, WantingNothingLeavesTheChoiceToTheServer) {
  EXPECT_EQ(negotiate({Bitstream{4, 2}, Bitstream{}}, kDefault), kDefault);
}

TEST(Negotiation, AnOldLibraryIsNeverSentMoreThanItKnows) {
  EXPECT_EQ(negotiate({Bitstream{2, 7}, {}}, kDefault), (Bitstream{2, 7}));
  EXPECT_EQ(negotiate({Bitstream{3, 0}, {}}, Bitstream{4, 1}), (Bitstream{3, 0}));
}

TEST(Negotiation, ALibraryVersionFromBeforeTheProtocolIsNoInformation) {
  EXPECT_EQ(negotiate({Bitstream{0, 0}, {}}, kDefault), kDefault);
  EXPECT_EQ(negotiate({Bitstream{1, 4}, {}}, kDefault), kDefault);
}

TEST(Negotiation, AlwaysEndsAtOneThatWeHave) {
  for (int major = 0; major < 256; ++major) {
    for (int minor = 0; minor < 256; ++minor) {
      const Bitstream any{static_cast<std::uint8_t>(major), static_cast<std::uint8_t>(minor)};
      EXPECT_TRUE(is_supported(negotiate({{}, any}, kDefault))) << text_of(any);
      EXPECT_TRUE(is_supported(negotiate({any, {}}, kDefault))) << text_of(any);
    }
  }
  EXPECT_EQ(negotiate({{}, Bitstream{255, 255}}, kDefault), kNewest);
  EXPECT_EQ(negotiate({{}, Bitstream{4, 3}}, kDefault), (Bitstream{4, 2}));
  EXPECT_EQ(negotiate({{}, Bitstream{3, 9}}, kDefault), (Bitstream{3, 1}));
  EXPECT_EQ(negotiate({{}, Bitstream{1, 0}}, kDefault), kOldest);
}

}  // namespace
}  // namespace fiducap::natnet
