#include "scene/body_name.hpp"

#include <gmock/gmock.h>

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::Optional;

TEST(BodyName, MayBeOfAnyScriptWithSpaces) {
  for (const char* name : {"drone", "left-arm v2.1", "Größe 1", "Crazyflie (blue)", "日本 1",
                           "дрон", "a+b", "_hidden", "1", "a.b"}) {
    EXPECT_EQ(body_name_fault(name), std::nullopt) << name;
  }
  EXPECT_EQ(body_name_fault(std::string(63, 'x')), std::nullopt);
}

TEST(BodyName, ReportsTheFaultOfAHostileOne) {
  const std::pair<std::string, const char*> kHostile[] = {
      {"", "must not be empty"},
      {std::string(64, 'x'), "at most 63 bytes, has 64"},
      {"a\u00a0b", "no other space than U+0020, has U+00A0"},
      {"a\u3000b", "no other space"},
      {"o\u0308l", "composed letters"},
      {"a\u2044b", "look like"},
      {"a\u201cb", "look like"},
      {"\uff1cb\uff1e", "look like"},
      {" a", "begin or end with a space"},
      {"a ", "begin or end with a space"},
      {"a  b", "two spaces"},
      {"..", "begin with . or -"},
      {"-rf", "begin with . or -"},
  };
  for (const auto& [name, fault] : kHostile)
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr(fault))) << shown_name(name);
  const std::pair<std::string, std::string> kInvisible[] = {
      {"a\nb", "U+000A"},     {"a\x1b[2J", "U+001B"},   {std::string("a\0b", 3), "U+0000"},
      {"a\x7f", "U+007F"},    {"a\xc2\x9bm", "U+009B"}, {"abc\u202egnp", "U+202E"},
      {"a\u2066b", "U+2066"}, {"a\u200bb", "U+200B"},   {"\ufeffa", "U+FEFF"},
      {"a\ue000", "U+E000"}};
  for (const auto& [name, code] : kInvisible)
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr("invisible characters, has " + code)));
  const std::pair<const char*, std::string> kForbidden[] = {
      {"a/b", "/"}, {"a\\b", "\\"}, {"a@b", "@"},  {"a\"b", "\""}, {"a'b", "'"}, {"<b>", "<"},
      {"a&b", "&"}, {"a,b", ","},   {"$(x)", "$"}, {"a;b", ";"},   {"a*", "*"}};
  for (const auto& [name, forbidden] : kForbidden)
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr("must not have " + forbidden)));
  for (const char* name : {"\xff", "a\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80"})
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr("must be UTF-8")));
}

TEST(BodyName, IsShownSoThatALineStaysALine) {
  EXPECT_EQ(shown_name("Größe 1"), "\"Größe 1\"");
  EXPECT_EQ(shown_name("a\x1b[2J\n"), "\"a\\x1b[2J\\x0a\"");
  EXPECT_EQ(shown_name("abc\u202egnp"), "\"abc\\u202egnp\"");
  EXPECT_EQ(shown_name("\xff"), "\"\\xff\"");
}

}  // namespace
}  // namespace fiducap
