#include "streaming/vrpn/sender_table.hpp"

#include <gmock/gmock.h>

namespace fiducap::vrpn {
namespace {

using testing::ElementsAre;

SceneModel model(std::uint64_t generation, const std::vector<std::string>& names) {
  SceneModel made{generation, {}};
  for (const auto& name : names)
    made.bodies.push_back({static_cast<int>(made.bodies.size()) + 1, name});
  return made;
}

TEST(VrpnSenderTable, PutsControlFirstAndBodiesBehindItWithoutHoles) {
  SenderTable table;
  EXPECT_TRUE(table.update(model(1, {"arm", "drone"})).empty());
  EXPECT_THAT(table.names(), ElementsAre("VRPN Control", "arm", "drone"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(1, 2));
  EXPECT_EQ(table.list_bodies(), "arm, drone");
}

TEST(VrpnSenderTable, NeverGivesAnIdToAnotherName) {
  SenderTable table;
  table.update(model(1, {"arm", "drone"}));
  table.update(model(2, {"rover", "drone"}));
  EXPECT_THAT(table.names(), ElementsAre("VRPN Control", "arm", "drone", "rover"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(3, 2));
  EXPECT_FALSE(table.find_body("arm"));
  EXPECT_EQ(table.find_body("rover"), 3);
  table.update(model(3, {"arm"}));
  EXPECT_EQ(table.find_body("arm"), 1);
}

TEST(VrpnSenderTable, ReadsAGenerationOnce) {
  SenderTable table;
  table.update(model(1, {"arm"}));
  table.update(model(1, {"other"}));
  EXPECT_FALSE(table.find_body("other"));
}

TEST(VrpnSenderTable, ServesNeitherBrokenNorDoubledNames) {
  SenderTable table;
  const auto refused =
      table.update(model(1, {"arm", "a@b", "arm", std::string(96, 'x'), "VRPN Control"}));
  EXPECT_THAT(refused, ElementsAre("a@b", "arm", std::string(96, 'x'), "VRPN Control"));
  EXPECT_THAT(table.of_bodies(), ElementsAre(1, -1, -1, -1, -1));
  EXPECT_FALSE(table.find_body("VRPN Control"));
}

TEST(VrpnSenderTable, ShowsAnAliasAndKnowsWhoseItIs) {
  SenderTable table(NameAliases{{"drone", "cf7"}, {"arm", "a@b"}});
  EXPECT_THAT(table.update(model(1, {"arm", "drone"})), ElementsAre("a@b"))
      << "an alias obeys the rules, too";
  EXPECT_FALSE(table.find_body("drone"));
  ASSERT_TRUE(table.find_body("cf7"));
  EXPECT_EQ(table.own_name_of(*table.find_body("cf7")), "drone");
}

TEST(VrpnSenderTable, MatchesNamesByteByByte) {
  SenderTable table;
  table.update(model(1, {"Arm"}));
  EXPECT_FALSE(table.find_body("arm"));
  EXPECT_FALSE(table.find_body("Arm "));
}

TEST(VrpnSenderTable, StopsAtTheLastIdThatClientsTake) {
  SenderTable table;
  std::vector<std::string> names;
  for (int i = 0; i < 2100; ++i) names.push_back("b" + std::to_string(i));
  EXPECT_EQ(table.update(model(1, names)).size(), 101u);  // 2000 ids, one is VRPN Control's
  EXPECT_EQ(table.of_bodies()[1998], 1999);
  EXPECT_EQ(table.of_bodies()[1999], -1);
}

TEST(VrpnBodyName, IsCheckedWithPathAndRule) {
  EXPECT_TRUE(check_body_name("bodies[0].name", std::string(95, 'x')).empty());
  EXPECT_TRUE(check_body_name("bodies[0].name", "Körper 1/a:b").empty());
  const auto errors = check_body_name("bodies[2].name", "a@\n");
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_EQ(errors[0].path, "bodies[2].name");
  EXPECT_EQ(check_body_name("x", "").size(), 1u);
  EXPECT_EQ(check_body_name("x", std::string(96, 'x')).size(), 1u);
  EXPECT_EQ(check_body_name("x", "VRPN Control").size(), 1u);
}

}  // namespace
}  // namespace fiducap::vrpn
