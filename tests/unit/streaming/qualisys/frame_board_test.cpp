#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "streaming/qualisys/frame_board.hpp"
#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

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

class QualisysFrameBoard : public testing::Test {
 protected:
  void put(std::uint64_t number) {
    const auto frame = make_scene_frame({"a"}, number);
    bodies_.update(*frame->model);
    board_.put(frame, bodies_);
  }
  BodyTable bodies_;
  FrameBoard board_{QualisysConfig{}};
  Profile profile_{Components::all(), std::endian::little, false};
};

TEST_F(QualisysFrameBoard, KnowsNoFrameAtFirst) { EXPECT_EQ(board_.number(), 0u); }

TEST_F(QualisysFrameBoard, EncodesOncePerProfile) {
  put(1);
  const auto first = board_.encoded(profile_);
  EXPECT_EQ(board_.encoded(profile_), first);
  Profile other = profile_;
  other.order = std::endian::big;
  EXPECT_NE(board_.encoded(other), first);
  EXPECT_EQ(board_.encoded(profile_), first);
}

TEST_F(QualisysFrameBoard, ANewFrameIsEncodedAgain) {
  put(1);
  const auto first = board_.encoded(profile_);
  put(2);
  EXPECT_NE(board_.encoded(profile_)->packet, first->packet);
}

TEST_F(QualisysFrameBoard, AllocatesNothingAfterWarmUp) {
  const auto frame = make_scene_frame({"a", "b"});
  bodies_.update(*frame->model);
  Profile other = profile_;
  other.wide = true;
  std::shared_ptr<const EncodedFrame> waiting;  // a slow client still holds the last one
  const auto round = [&] {
    board_.put(frame, bodies_);
    waiting = board_.encoded(profile_);
    (void)board_.encoded(other);
  };
  for (int i = 0; i < 10; ++i) round();
  const AllocationCounter counter;
  for (int i = 0; i < 100; ++i) round();
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap::qualisys
