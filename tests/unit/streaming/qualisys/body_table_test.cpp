#include "streaming/qualisys/body_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap::qualisys {
namespace {

using testing::ElementsAre;

SceneModel model_of(std::uint64_t generation, std::vector<BodyDescription> bodies) {
  SceneModel model;
  model.generation = generation;
  model.bodies = std::move(bodies);
  return model;
}

TEST(QualisysBodyTable, TakesTheBodiesInTheirOrder) {
  BodyTable table;
  EXPECT_TRUE(table.update(model_of(1, {{1, "arm"}, {2, "drone"}})));
  ASSERT_EQ(table.entries().size(), 2u);
  EXPECT_EQ(table.entries()[1].name, "drone");
  EXPECT_THAT(table.index_of_body(), ElementsAre(0, 1));
}

TEST(QualisysBodyTable, ShowsAnAlias) {
  BodyTable table(NameAliases{{"drone", "cf <7>"}});
  table.update(model_of(1, {{1, "arm"}, {2, "drone"}}));
  EXPECT_EQ(table.entries()[0].name, "arm");
  EXPECT_EQ(table.entries()[1].name, "cf _7_");
}

TEST(QualisysBodyTable, TheSameGenerationChangesNothing) {
  BodyTable table;
  table.update(model_of(1, {{1, "arm"}}));
  EXPECT_FALSE(table.update(model_of(1, {{1, "arm"}})));
}

TEST(QualisysBodyTable, ADisabledBodyKeepsItsPlace) {
  BodyTable table;
  table.update(model_of(1, {{1, "arm"}, {2, "drone"}}));
  EXPECT_TRUE(table.update(model_of(2, {{2, "drone"}})));
  ASSERT_EQ(table.entries().size(), 2u);
  EXPECT_FALSE(table.entries()[0].enabled);
  EXPECT_THAT(table.index_of_body(), ElementsAre(1));
  table.update(model_of(3, {{1, "arm"}, {2, "drone"}}));
  EXPECT_TRUE(table.entries()[0].enabled);
  EXPECT_THAT(table.index_of_body(), ElementsAre(0, 1));
}

TEST(QualisysBodyTable, ARenamedBodyKeepsItsPlaceAndANewOneComesLast) {
  BodyTable table;
  table.update(model_of(1, {{1, "arm"}, {2, "drone"}}));
  table.update(model_of(2, {{3, "rover"}, {1, "left arm"}, {2, "drone"}}));
  ASSERT_EQ(table.entries().size(), 3u);
  EXPECT_EQ(table.entries()[0].name, "left arm");
  EXPECT_EQ(table.entries()[2].name, "rover");
  EXPECT_THAT(table.index_of_body(), ElementsAre(2, 0, 1));
}

}  // namespace
}  // namespace fiducap::qualisys
