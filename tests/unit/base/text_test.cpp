#include "base/text.hpp"

#include <gmock/gmock.h>

#include "base/yaml.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

TEST(ClosestWord, FindsMistypedKeysAndUnits) {
  const std::vector<std::string> keys{"size_m",        "sizes_m", "family",  "ignore",
                                      "reference_tag", "rate_hz", "cameras", "up"};
  const std::pair<std::string, const char*> kCases[]{{"famly", "family"},
                                                     {"faimly", "family"},
                                                     {"camera", "cameras"},
                                                     {"Reference-Tag", "reference_tag"},
                                                     {"size_n", "size_m"},
                                                     {"size", "size_m"},
                                                     {"size_mm", "size_m"},
                                                     {"rate", "rate_hz"},
                                                     {"bodies", "-"},
                                                     {"x", "-"},
                                                     {"", "-"},
                                                     {std::string(1000, 'a'), "-"}};
  for (const auto& [written, meant] : kCases)
    EXPECT_EQ(closest_word(written, keys).value_or("-"), meant) << written;
  EXPECT_EQ(did_you_mean("famly", keys), "did you mean family?");
  EXPECT_EQ(did_you_mean("zzz", keys), "");
}

std::u32string all_of(std::string_view text) {
  std::u32string out;
  while (!text.empty()) out += take_character(text).value_or(U'\ufffd');
  return out;
}

TEST(Utf8, IsReadCharacterByCharacter) {
  EXPECT_EQ(all_of("aö日\U0001F681"), U"aö日\U0001F681");
  EXPECT_EQ(all_of("\x7f\u0080\u07ff\u0800\uffff\U00010000\U0010ffff"),
            U"\x7f\u0080\u07ff\u0800\uffff\U00010000\U0010ffff");
}

TEST(Utf8, InvalidSequenceCostsItsFirstByteOnly) {
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

TEST(Printable, EscapesControlCharactersOnly) {
  EXPECT_EQ(printable("Größe\n\x1b[2J\x7f 日\u00a0"), "Größe\\x0a\\x1b[2J\\x7f 日\u00a0");
  // U+0080 to U+009F, as UTF-8 and as bytes: terminals obey both.
  EXPECT_EQ(printable("x\u009b31m\u0080\x9b"
                      "2Jé"),
            "x\\xc2\\x9b31m\\xc2\\x80\\x9b2Jé");
  EXPECT_EQ(printable("\xc3"), "\\xc3") << "cut";
  EXPECT_EQ(printable("\xe0\x80\xaf"), "\\xe0\\x80\\xaf") << "overlong";
}

TEST(Printable, LimitsWhatIsShown) {
  EXPECT_EQ(printable("abcd", 4), "abcd");
  EXPECT_EQ(printable("abcde", 4), "abcd...");
  EXPECT_EQ(printable("Größe", 3), "Gr...") << "no half of a character";
  EXPECT_EQ(printable("a\n\n", 8), "a\\x0a...") << "no half of an escape";
  EXPECT_EQ(printable(std::string(256, '\x1b'), 64).size(), 64u + 3);
}

TEST(YamlText, AliasRepeatsItsAnchor) {
  const auto root =
      value_of(load_yaml("lens: &l {fu: 500}\ncameras: [{model: *l}, {model: *l}]\n"));
  EXPECT_EQ(root["cameras"][1]["model"]["fu"].as<int>(), 500);
}

TEST(YamlText, HasOneDocument) {
  EXPECT_THAT(error_of(load_yaml("tags: {size_m: 0.1}\n---\noperator: {token: secret}\n")),
              HasSubstr("holds several documents"));
  for (const char* comma : {",", ", ]", "a: 1\n...\n,"})
    EXPECT_FALSE(load_yaml(comma)) << "yaml-cpp reads this for ever: " << comma;
  for (const char* one :
       {"---\ntags: {size_m: 0.1}\n", "tags: {size_m: 0.1}\n---\n", "tags: {size_m: 0.1}\n...\n"})
    EXPECT_TRUE(value_of(load_yaml(one))["tags"]) << one;
  EXPECT_FALSE(load_yaml("tags: {size_m: 0.1}\n---\n---\n"));
  EXPECT_TRUE(load_yaml("# nothing\n"));
}

TEST(YamlText, RefusesAnAliasInsideItsAnchor) {
  const auto root = load_yaml("tags: {}\nbodies: &a [{name: b}, *a]\n");
  ASSERT_FALSE(root);
  EXPECT_EQ(root.error().line, 2);
  EXPECT_EQ(root.error().text(),
            "bodies.1 = an alias: repeats the list or section that contains it");
}

/// Levels `l0`, `l1` …, each of which repeats the one before.
std::string levels(int count, const std::string& first, const std::string& before,
                   const std::string& between, int times, const std::string& after) {
  std::string text = "l0: &l0 " + first + "\n";
  for (int level = 1; level < count; ++level) {
    const std::string name = "l" + std::to_string(level);
    const std::string below = "*l" + std::to_string(level - 1);
    text += name + ": &" + name + " " + before + below;
    for (int i = 1; i < times; ++i) text += between + below;
    text += after + "\n";
  }
  return text;
}

TEST(YamlText, BoundsTheSizeAndDepthOfAliases) {
  const auto wide = load_yaml(levels(12, "[x, x, x, x, x, x, x, x, x]", "[", ", ", 9, "]"));
  EXPECT_THAT(error_of(wide), HasSubstr("aliases repeat more than 10000 values"));
  EXPECT_THAT(wide.error().path, HasSubstr("l4"));
  EXPECT_THAT(error_of(load_yaml(levels(20, "[x]", "[[[[[[[[", "", 1, "]]]]]]]]"))),
              HasSubstr("is deeper than 100 levels"));
}

TEST(YamlText, FaultHasItsLine) {
  for (const std::string& text :
       {std::string("a: 1\nb: [1, 2\n"), "a: 1\n" + std::string(20'000, '['),
        std::string("a: 1\nb: *unknown\n")}) {
    const auto root = load_yaml(text);
    EXPECT_THAT(error_of(root), HasSubstr("is not YAML"));
    EXPECT_GE(root.error().line, 2);
  }
}

}  // namespace
}  // namespace fiducap
