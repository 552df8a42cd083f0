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
      {"a\nb", "invisible characters, has U+000A"},
      {"a\x1b[2J", "invisible characters, has U+001B"},
      {std::string("a\0b", 3), "invisible characters, has U+0000"},
      {"a\x7f", "invisible characters, has U+007F"},
      {"a\xc2\x9bm", "invisible characters, has U+009B"},
      {"abc\u202egnp", "invisible characters, has U+202E"},
      {"a\u2066b", "invisible characters, has U+2066"},
      {"a\u200bb", "invisible characters, has U+200B"},
      {"\ufeffa", "invisible characters, has U+FEFF"},
      {"a\ue000", "invisible characters, has U+E000"},
      {"a\u00a0b", "no other space than U+0020, has U+00A0"},
      {"a\u3000b", "no other space"},
      {"o\u0308l", "composed letters"},
      {"a\u2044b", "look like"},
      {"a\u201cb", "look like"},
      {"\uff1cb\uff1e", "look like"},
      {"a/b", "must not have /"},
      {"a\\b", "must not have \\"},
      {"a@b", "must not have @"},
      {"a\"b", "must not have \""},
      {"a'b", "must not have '"},
      {"<b>", "must not have <"},
      {"a&b", "must not have &"},
      {"a,b", "must not have ,"},
      {"$(x)", "must not have $"},
      {"a;b", "must not have ;"},
      {"a*", "must not have *"},
      {" a", "begin or end with a space"},
      {"a ", "begin or end with a space"},
      {"a  b", "two spaces"},
      {"..", "begin with . or -"},
      {"-rf", "begin with . or -"},
      {"\xff", "must be UTF-8"},
      {"a\xc3", "must be UTF-8"},
      {"\xc0\xaf", "must be UTF-8"},
      {"\xed\xa0\x80", "must be UTF-8"},
      {"\xf4\x90\x80\x80", "must be UTF-8"},
  };
  for (const auto& [name, fault] : kHostile)
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr(fault))) << shown_name(name);
}

TEST(BodyName, IsShownSoThatALineStaysALine) {
  EXPECT_EQ(shown_name("Größe 1"), "\"Größe 1\"");
  EXPECT_EQ(shown_name("a\x1b[2J\n"), "\"a\\x1b[2J\\x0a\"");
  EXPECT_EQ(shown_name("abc\u202egnp"), "\"abc\\u202egnp\"");
  EXPECT_EQ(shown_name("\xff"), "\"\\xff\"");
}

}  // namespace
}  // namespace fiducap
