#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

std::string ascii(std::u32string_view text) {
  std::string out;
  for (const char32_t c : text)
    out += c < 0x80 ? std::string(1, static_cast<char>(c)) : ascii_of(c);
  return out;
}

TEST(Transliteration, ReplacesLettersByTheirUsualSpellingElseByNumber) {
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
  EXPECT_EQ(ascii(U"日本"), "u65e5u672c");
  EXPECT_EQ(ascii_of(U'\U0001F681'), "u1f681");
  EXPECT_EQ(ascii_of(0x80), "u0080");
}

TEST(Transliteration, ConsistsOfLettersAndDigits) {
  const auto good = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  for (char32_t c = 0x80; c <= 0x2fff; ++c) {
    const std::string written = ascii_of(c);
    EXPECT_FALSE(written.empty());
    EXPECT_TRUE(std::all_of(written.begin(), written.end(), good)) << written;
  }
}

SceneModel model_of(const std::vector<std::string>& names) {
  return *make_scene_frame(names)->model;
}

TEST(ClientNames, ReplacesForbiddenBytesByUnderscores) {
  const NameRule ros{20, "-./", true, false};
  EXPECT_EQ(client_name("left-arm v2.1", ros), "left_arm_v2_1");
  EXPECT_EQ(client_name("Größe 1", ros), "Groesse_1");
  EXPECT_EQ(client_name("日 1", ros), "u65e5_1");
  EXPECT_EQ(client_name("gr\xf6\xdfg", {}), "gr__g") << "no UTF-8";
  EXPECT_EQ(client_name("größe", {}), "größe");
  EXPECT_EQ(client_name("a\nb\x7f", {}), "a_b_");
}

TEST(ClientNames, KeepUtf8InProtocolsThatCarryIt) {
  const auto in = [](std::string_view protocol) {
    return client_name("Größe 1", conventions_of(protocol).names);
  };
  for (const auto* utf8 : {"vrpn", "natnet", "qualisys", "native"})
    EXPECT_EQ(in(utf8), "Größe 1") << utf8;
  for (const auto* other : {"vicon", "ros2", "px4"}) EXPECT_EQ(in(other), "Groesse_1") << other;
}

TEST(ClientNames, AliasReplacesTheNameUnderTheSameRule) {
  EXPECT_EQ(client_name("drone", {}, {{"drone", "RigidBody 1"}}), "RigidBody 1");
  EXPECT_EQ(client_name("drone", {10, " "}, {{"drone", "RigidBody 1"}}), "RigidBody_");
}

TEST(ClientNames, CutBetweenCharactersAndAreNeverEmpty) {
  EXPECT_EQ(client_name("abcö", {4}), "abc");
  EXPECT_EQ(client_name("abcö", {5}), "abcö");
  EXPECT_EQ(client_name("", {}), "_");
  EXPECT_EQ(client_name("öö", {1}), "_");
}

TEST(ClientNames, StayDistinctAfterCuttingAndReplacing) {
  EXPECT_EQ(client_names(model_of({"arm-1", "arm.1", "arm_1"}), {127, "-."}),
            (std::vector<std::string>{"arm_1_2", "arm_1_3", "arm_1"}))
      << "a name that fits is kept";
  EXPECT_EQ(client_names(model_of({"walker-left", "walker-right"}), {7}),
            (std::vector<std::string>{"walker-", "walke_2"}));
}

const std::vector<std::string> kAlphabet{"a", "b", "_",  "-", ".",  " ", "1",
                                         "2", "ö", "oe", "ß", "日", "(", "+"};

/// Names of few letters, so that many become equal; all different.
std::vector<std::string> names_of(std::mt19937& dice, std::size_t n) {
  std::set<std::string> names;
  while (names.size() < n) {
    std::string name;
    for (std::size_t left = 1 + dice() % 4; left > 0; --left)
      name += kAlphabet[dice() % kAlphabet.size()];
    names.insert(name);
  }
  std::vector<std::string> all(names.begin(), names.end());
  std::shuffle(all.begin(), all.end(), dice);
  return all;
}

TEST(ClientNames, AreDistinctAndReproducibleInEveryProtocol) {
  std::mt19937 dice(7);
  for (int round = 0; round < 50; ++round) {
    const SceneModel model = model_of(names_of(dice, 100));
    for (const auto& protocol : kProtocolConventions) {
      if (protocol.names.max_bytes == 0) continue;  // MAVLink has no names
      for (const std::size_t most : {protocol.names.max_bytes, std::size_t{6}}) {
        NameRule rule = protocol.names;
        rule.max_bytes = most;
        const auto names = client_names(model, rule);
        EXPECT_EQ(std::set(names.begin(), names.end()).size(), names.size()) << protocol.protocol;
        EXPECT_EQ(client_names(model, rule), names);
        for (const auto& name : names) {
          EXPECT_LE(name.size(), most);
          EXPECT_EQ(client_name(name, rule), name) << "fits, and is whole UTF-8";
        }
      }
    }
  }
}

TEST(ProtocolConventions, ListsEachProtocolOnce) {
  std::set<std::string_view> names;
  for (const auto& one : kProtocolConventions) {
    EXPECT_TRUE(names.insert(one.protocol).second) << one.protocol;
    EXPECT_EQ(&conventions_of(one.protocol), &one);
    EXPECT_NE(one.when_invalid, WhenInvalid::kHold)
        << "a stale pose must not look live by default: " << one.protocol;
  }
}

/// A point of the body is at the same place of the world in every protocol's axes and units.
}  // namespace
}  // namespace fiducap
