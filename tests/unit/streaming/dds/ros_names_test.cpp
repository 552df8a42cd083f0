#include "streaming/dds/ros_names.hpp"

#include <gmock/gmock.h>

#include <random>

namespace fiducap::dds {
namespace {

using testing::ElementsAre;

SceneModel model_of(const std::vector<std::string>& names) {
  SceneModel model;
  for (const auto& name : names)
    model.bodies.push_back({static_cast<int>(model.bodies.size()) + 1, name});
  return model;
}

TEST(RosNames, GoodNamesStay) {
  EXPECT_THAT(ros_names(model_of({"drone", "cf_7"})), ElementsAre("drone", "cf_7"));
}

TEST(RosNames, AnAliasStandsForTheName) {
  EXPECT_THAT(ros_names(model_of({"drone", "arm"}), {{"drone", "cf 7"}}),
              ElementsAre("cf_7", "arm"));
}

TEST(RosNames, WhatRosForbidsBecomesAnUnderscoreLettersStayReadable) {
  EXPECT_THAT(ros_names(model_of({"big-drone.v2", "7up", "_x__y_", "Größe 1", "日", "(+)"})),
              ElementsAre("big_drone_v2", "body_7up", "body_x_y", "Groesse_1", "u65e5", "body"));
  std::string longest;
  while (longest.size() + 2 <= 63) longest += "щ";
  EXPECT_TRUE(is_ros_name(ros_names(model_of({longest})).front()));
}

TEST(RosNames, EqualNamesAreToldApart) {
  EXPECT_THAT(ros_names(model_of({"a-b", "a.b", "a_b"})), ElementsAre("a_b_2", "a_b_3", "a_b"))
      << "who is one already keeps its name";
}

TEST(RosNames, AreLegalAndDistinctWhateverTheBodiesAreCalled) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    std::vector<std::string> names;
    for (int i = 0; i < 8; ++i) {
      std::string name;
      for (unsigned k = 0; k < random() % 6; ++k)
        name += static_cast<char>(random() % 3 == 0 ? random() % 256 : 'a');
      names.push_back(name);
    }
    auto given = ros_names(model_of(names));
    for (const auto& name : given) EXPECT_TRUE(is_ros_name(name)) << '"' << name << '"';
    std::sort(given.begin(), given.end());
    EXPECT_EQ(std::unique(given.begin(), given.end()), given.end());
  }
}

TEST(RosNames, NamespacesBeginWithASlashAndDoNotEndWithOne) {
  EXPECT_TRUE(is_ros_namespace("/fiducap"));
  EXPECT_TRUE(is_ros_namespace("/lab/fiducap"));
  for (const char* bad : {"fiducap", "/", "/fiducap/", "//a", "/7", "/a b"})
    EXPECT_FALSE(is_ros_namespace(bad)) << bad;
}

}  // namespace
}  // namespace fiducap::dds
