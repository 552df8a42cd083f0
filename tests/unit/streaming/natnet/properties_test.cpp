#include "streaming/natnet/properties.hpp"

#include <gtest/gtest.h>

#include "fake_desk.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {
namespace {

class PropertiesTest : public testing::Test {
 protected:
  PropertiesTest() {
    server_.desk = &desk_;
    server_.rate_hz = 240;
    server_.frame = make_scene_frame({"arm", "drone"});
    server_.model = server_.frame->model;
    server_.announced = server_.model->bodies;
  }
  std::string get(std::string_view text) {
    return get_property(parse_command(text), server_).value_or("none");
  }
  bool set(std::string_view text) { return set_property(parse_command(text), server_).has_value(); }

  FakeDesk desk_;
  ServerView server_;
};

TEST_F(PropertiesTest, OfTheServer) {
  EXPECT_EQ(get("GetProperty,,FrameRate"), "240");
  EXPECT_EQ(get("GetProperty,Master Rate"), "240");
  EXPECT_EQ(get("GetProperty,,Up Axis"), "Y Axis");
  EXPECT_EQ(get("GetProperty,,bitstream"), "3.1");
  EXPECT_EQ(get("GetProperty,,Colour"), "none");
}

TEST_F(PropertiesTest, UpAxisIsWhatIsStreamed) {
  server_.config.up = UpAxis::kZ;
  EXPECT_EQ(get("GetProperty,,UpAxis"), "Z Axis");
}

TEST_F(PropertiesTest, OfABody) {
  EXPECT_EQ(get("GetProperty,drone,Name"), "drone");
  EXPECT_EQ(get("GetProperty,2,Name"), "drone");
  EXPECT_EQ(get("GetProperty,drone,Streaming ID"), "2");
  EXPECT_EQ(get("GetProperty,drone,Active"), "true");
  EXPECT_EQ(get("GetProperty,spare,Active"), "false");
  EXPECT_EQ(get("GetProperty,drone,TrackingValid"), "true");
  EXPECT_EQ(get("GetProperty,spare,TrackingValid"), "false");
  EXPECT_EQ(get("GetProperty,nobody,Name"), "none");
}

TEST_F(PropertiesTest, TheNameIsTheOneThatClientsSee) {
  server_.config.aliases = {{"drone", "Rigid Body 1"}, {"spare", "Rigid Body 2"}};
  server_.announced[1].name = "Rigid Body 1";
  EXPECT_EQ(get("GetProperty,Rigid Body 1,Name"), "Rigid Body 1");
  EXPECT_EQ(get("GetProperty,drone,Name"), "Rigid Body 1");
  EXPECT_EQ(get("GetProperty,Rigid Body 2,Name"), "Rigid Body 2") << "one that is switched off";
}

TEST_F(PropertiesTest, NameAndActiveCanBeSet) {
  EXPECT_TRUE(set("SetProperty,drone,Active,False"));
  EXPECT_FALSE(desk_.find(2)->enabled);
  EXPECT_TRUE(set("SetProperty,2,Enabled,1"));
  EXPECT_TRUE(desk_.find(2)->enabled);
  EXPECT_TRUE(set("SetProperty,drone,Name,copter"));
  EXPECT_EQ(desk_.find(2)->name, "copter");
}

TEST_F(PropertiesTest, NothingElseCan) {
  EXPECT_FALSE(set("SetProperty,drone,Active,perhaps"));
  EXPECT_FALSE(set("SetProperty,drone,Streaming ID,9"));
  EXPECT_FALSE(set("SetProperty,,Up Axis,Z Axis"));
  EXPECT_FALSE(set("SetProperty,drone,Name"));
  EXPECT_FALSE(set("SetProperty,nobody,Name,x"));
}

}  // namespace
}  // namespace fiducap::natnet
