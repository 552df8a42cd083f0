#include "streaming/natnet/answer.hpp"

#include <gtest/gtest.h>

#include <set>

#include "messages.hpp"
#include "streaming/natnet/request.hpp"
#include "support/hex.hpp"

namespace fiducap::natnet {
namespace {

const std::vector<BodyDescription> kTwo{{9, "arm"},
                                        {12,
                                         "k\xc3\xa4"
                                         "fer"}};
const NameRule kRule{255, ",", false, true};

SceneModel model_of(int bodies, std::size_t name_bytes) {
  SceneModel model;
  for (int i = 1; i <= bodies; ++i) {
    std::string name = std::to_string(i) + "_";
    name.resize(name_bytes, 'n');
    model.bodies.push_back({i, name});
  }
  return model;
}

TEST(ModelEncoder, BeforeThreeThereAreNoMarkers) {
  EXPECT_EQ(
      to_hex(encode_model(kTwo, ModelLayout::k2_5)),
      to_hex(from_hex("0500 3f00 02000000"
                      "01000000 61726d00       09000000 ffffffff 000000000000000000000000"
                      "01000000 6bc3a4666572 00 0c000000 ffffffff 000000000000000000000000")));
}

TEST(ModelEncoder, FromThreeAnEmptyListOfMarkersFollows) {
  const std::span one(kTwo.data(), 1);
  const auto wanted = from_hex(
      "0500 2400 01000000 01000000 61726d00 09000000 ffffffff 000000000000000000000000 00000000");
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k3_0)), to_hex(wanted));
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k4_0)), to_hex(wanted));
}

TEST(ModelEncoder, FromFourOneEachDescriptionSaysItsSize) {
  const std::span one(kTwo.data(), 1);
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k4_1)),
            to_hex(from_hex("0500 2800 01000000 01000000 1c000000 61726d00 09000000 ffffffff"
                            "000000000000000000000000 00000000")));
}

TEST(ModelEncoder, FromFourTwoARotationFollowsTheOffset) {
  const std::span one(kTwo.data(), 1);
  EXPECT_EQ(to_hex(encode_model(one, ModelLayout::k4_2)),
            to_hex(from_hex("0500 3800 01000000 01000000 2c000000 61726d00 09000000 ffffffff"
                            "000000000000000000000000 0000000000000000000000000000803f 00000000")));
}

TEST(ModelEncoder, SaysNothingOfTypesThatWereNotAskedFor) {
  EXPECT_EQ(encode_model(kTwo, ModelLayout::k4_1, 1U << 5), from_hex("0500 0400 00000000"));
  EXPECT_EQ(encode_model(kTwo, ModelLayout::k4_1, ModelRequest::kRigidBodies),
            encode_model(kTwo, ModelLayout::k4_1));
}

TEST(AnnouncedBodies, NamesCanBeAddressedByCommands) {
  SceneModel model;
  model.bodies = {{1, "left,arm"}, {2, "left_arm"}, {3, "tab\there"}};
  const auto bodies = announced_bodies(model, kRule, {{"tab\there", "alias"}});
  EXPECT_EQ(bodies[0].name, "left_arm_2");
  EXPECT_EQ(bodies[1].name, "left_arm") << "a name that fits as it is stays";
  EXPECT_EQ(bodies[2].name, "alias");
  EXPECT_EQ(bodies[2].id, 3);
}

TEST(AnnouncedBodies, ANameOf64KilobytesIsCutToWhatClientsHold) {
  EXPECT_EQ(announced_bodies(model_of(1, 65536), kRule).front().name.size(), kMaxName);
}

TEST(AnnouncedBodies, AThousandBodiesFitOneDatagramInEveryLayout) {
  const auto bodies = announced_bodies(model_of(1000, 255), kRule);
  ASSERT_EQ(bodies.size(), 1000U);
  std::set<std::string> names;
  for (const auto& body : bodies) EXPECT_TRUE(names.insert(body.name).second) << body.name;
  for (const auto layout : {ModelLayout::k2_5, ModelLayout::k3_0, ModelLayout::k4_0,
                            ModelLayout::k4_1, ModelLayout::k4_2}) {
    EXPECT_LE(encode_model(bodies, layout).size(), kMaxDatagram);
  }
}

TEST(AnnouncedBodies, ShortNamesOfAThousandBodiesStayAsTheyAre) {
  const auto model = model_of(1000, 12);
  const auto bodies = announced_bodies(model, kRule);
  for (std::size_t i = 0; i < bodies.size(); ++i) ASSERT_EQ(bodies[i].name, model.bodies[i].name);
}

TEST(AnnouncedBodies, MoreThanClientsTakeAreLeftOut) {
  EXPECT_EQ(announced_bodies(model_of(1300, 6), kRule).size(), kMaxBodies);
}

}  // namespace
}  // namespace fiducap::natnet
