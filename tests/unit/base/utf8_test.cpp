#include "base/utf8.hpp"

#include <gtest/gtest.h>

#include <string>

namespace fiducap {
namespace {

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

}  // namespace
}  // namespace fiducap
