#include "base/closest_word.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace fiducap
