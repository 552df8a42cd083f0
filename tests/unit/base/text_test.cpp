#include "base/text.hpp"

#include <gtest/gtest.h>

#include <string>

namespace fiducap {
namespace {

const std::vector<std::string> kKeys{"size_m",        "sizes_m", "family",  "ignore",
                                     "reference_tag", "rate_hz", "cameras", "up"};

std::string meant(std::string_view written) { return closest_word(written, kKeys).value_or("-"); }

TEST(ClosestWord, FindsWhatIsMistyped) {
  EXPECT_EQ(meant("famly"), "family");
  EXPECT_EQ(meant("faimly"), "family");
  EXPECT_EQ(meant("camera"), "cameras");
  EXPECT_EQ(meant("Reference-Tag"), "reference_tag");
  EXPECT_EQ(meant("size_n"), "size_m");
}

TEST(ClosestWord, KnowsAForgottenOrWrongUnit) {
  EXPECT_EQ(meant("size"), "size_m");
  EXPECT_EQ(meant("size_mm"), "size_m");
  EXPECT_EQ(meant("rate"), "rate_hz");
}

TEST(ClosestWord, SaysNothingOfWhatIsNothingLikeIt) {
  EXPECT_EQ(meant("bodies"), "-");
  EXPECT_EQ(meant("x"), "-");
  EXPECT_EQ(meant(""), "-");
  EXPECT_EQ(meant(std::string(1000, 'a')), "-");
}

TEST(ClosestWord, AsksInWords) {
  EXPECT_EQ(did_you_mean("famly", kKeys), "did you mean family?");
  EXPECT_EQ(did_you_mean("zzz", kKeys), "");
}

std::u32string all_of(std::string_view text) {
  std::u32string out;
  while (!text.empty()) out += take_character(text).value_or(U'\ufffd');
  return out;
}

TEST(Utf8, TakesOneCharacterAfterTheOther) {
  EXPECT_EQ(all_of("aö日\U0001F681"), U"aö日\U0001F681");
  EXPECT_EQ(all_of("\x7f\u0080\u07ff\u0800\uffff\U00010000\U0010ffff"),
            U"\x7f\u0080\u07ff\u0800\uffff\U00010000\U0010ffff");
}

TEST(Utf8, WhatIsNoneCostsItsFirstByteOnly) {
  EXPECT_EQ(all_of("\x80z"), U"\ufffdz");
  EXPECT_EQ(all_of("\xc3z"), U"\ufffdz") << "cut";
  EXPECT_EQ(all_of("\xe6\x97"), U"\ufffd\ufffd") << "cut at the end";
  EXPECT_EQ(all_of("\xc0\xaf"), U"\ufffd\ufffd") << "overlong";
  EXPECT_EQ(all_of("\xe0\x80\xaf"), U"\ufffd\ufffd\ufffd") << "overlong";
  EXPECT_EQ(all_of("\xf0\x80\x80\xaf"), U"\ufffd\ufffd\ufffd\ufffd") << "overlong";
  EXPECT_EQ(all_of("\xed\xa0\x80"), U"\ufffd\ufffd\ufffd") << "a surrogate";
  EXPECT_EQ(all_of("\xf4\x90\x80\x80"), U"\ufffd\ufffd\ufffd\ufffd") << "beyond the last";
  EXPECT_EQ(all_of("\xff"), U"\ufffd");
}

TEST(EscapeControls, EscapesWhatMovesTheCursorAndKeepsTheRest) {
  EXPECT_EQ(escape_controls("Größe\n\x1b[2J\x7f"), "Größe\\x0a\\x1b[2J\\x7f");
}

}  // namespace
}  // namespace fiducap
