#include "streaming/conventions/transliteration.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace fiducap {
namespace {

std::string ascii(std::u32string_view text) {
  std::string out;
  for (const char32_t c : text)
    out += c < 0x80 ? std::string(1, static_cast<char>(c)) : ascii_of(c);
  return out;
}

TEST(Transliteration, WritesLettersAsTheirReadersWould) {
  EXPECT_EQ(ascii(U"Größe"), "Groesse");
  EXPECT_EQ(ascii(U"ÄÖÜ"), "AeOeUe");
  EXPECT_EQ(ascii(U"Ångström Ærø œuvre"), "Aangstroem Aeroe oeuvre");
  EXPECT_EQ(ascii(U"garçon élève naïf"), "garcon eleve naif");
  EXPECT_EQ(ascii(U"łódź žluťoučký"), "lodz zlutoucky");
  EXPECT_EQ(ascii(U"Bucureștiți"), "Bucurestiti");
  EXPECT_EQ(ascii(U"Nguyễn"), "Nguyen");
  EXPECT_EQ(ascii(U"Þór Ŋ"), "Thor Ng");
  EXPECT_EQ(ascii(U"Αθήνα ψ"), "Athina ps");
  EXPECT_EQ(ascii(U"Ёж щука"), "Yozh shchuka");
}

TEST(Transliteration, WritesWhatItHasNoLetterForByItsNumber) {
  EXPECT_EQ(ascii(U"日本"), "u65e5u672c");
  EXPECT_EQ(ascii_of(U'\U0001F681'), "u1f681");
  EXPECT_EQ(ascii_of(0x80), "u0080");
}

TEST(Transliteration, IsNeverEmptyAndOfLettersAndDigits) {
  const auto good = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  for (char32_t c = 0x80; c <= 0x2fff; ++c) {
    const std::string written = ascii_of(c);
    EXPECT_FALSE(written.empty());
    EXPECT_TRUE(std::all_of(written.begin(), written.end(), good)) << written;
  }
}

}  // namespace
}  // namespace fiducap
