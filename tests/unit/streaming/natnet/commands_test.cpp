#include "streaming/natnet/commands.hpp"

#include <gtest/gtest.h>

#include "messages.hpp"
#include "support/fake_operator_api.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {
namespace {

constexpr std::int32_t kDone = 0;
constexpr std::int32_t kRefused = 1;
constexpr Peer kHere{0x7f000001, 4000};
constexpr Peer kElsewhere{0x0a000001, 4000};

using Texts = std::initializer_list<std::string>;

class CommandWordsTest : public testing::Test {
 protected:
  CommandWordsTest() {
    operator_api_.all = {
        {1, "arm", true, Pose{}}, {2, "drone", true, Pose{}}, {3, "spare", false, Pose{}}};
    server_.operator_api = &operator_api_;
    server_.config.remote_control = RemoteControl::kLoopback;
    server_.rate_hz = 120;
    server_.frame = make_scene_frame({"arm", "drone"});
    server_.model = server_.frame->model;
    server_.announced = server_.model->bodies;
    subscriber_.version = {3, 1};
  }
  CommandWords::Answer ask(std::string_view text) {
    return words_.answer(text, server_, {from_, multicast_, {3, 1}, &subscriber_});
  }
  std::int32_t number(std::string_view text) { return number_in(ask(text).datagram); }
  std::string text(std::string_view question) { return text_in(ask(question).datagram); }
  void expect(std::int32_t result, const Texts& commands) {
    for (const auto& command : commands)
      EXPECT_EQ(number(command), result) << command.substr(0, 60);
  }
  void expect(Message kind, const Texts& commands) {
    for (const auto& command : commands)
      EXPECT_EQ(id_of(ask(command).datagram), kind) << command.substr(0, 60);
  }
  [[nodiscard]] bool enabled(std::size_t id) const { return operator_api_.all[id - 1].enabled; }

  FakeOperatorApi operator_api_;
  ServerView server_;
  CommandWords words_;
  Subscriber subscriber_;
  Peer from_{kHere};
  bool multicast_{false};
};

TEST_F(CommandWordsTest, AnswersWithNumbersAndText) {
  EXPECT_EQ(ask("FrameRate").datagram, encode_response(120.0F));
  EXPECT_EQ(ask("UnitsToMillimeters").datagram, encode_response(1000.0F));
  EXPECT_EQ(number("AnalogSamplesPerMocapFrame"), 0);
  EXPECT_EQ(number("CurrentTakeLength"), 0);
  EXPECT_EQ(text("CurrentSessionPath"), "/");
  const auto answer = ask("Disconnect");
  EXPECT_EQ(number_in(answer.datagram), kDone);
  EXPECT_TRUE(answer.leaves);
}

TEST_F(CommandWordsTest, AnswersEveryKnownCommandOfClients) {
  expect(Message::kResponse, {"UnitsToMillimeters",
                              "FrameRate",
                              "CurrentMode",
                              "LiveMode",
                              "EditMode",
                              "StartRecording",
                              "StopRecording",
                              "SetRecordTakeName,take",
                              "SetPlaybackTakeName,take",
                              "SetCurrentSession,day",
                              "TimelinePlay",
                              "TimelineStop",
                              "SetPlaybackStartFrame,1",
                              "SetPlaybackStopFrame,2",
                              "SetPlaybackCurrentFrame,0",
                              "SetPlaybackLooping,1",
                              "EnableAsset,arm",
                              "DisableAsset,arm",
                              "EnableAsset,arm",
                              "GetProperty,,FrameRate",
                              "SetProperty,arm,Active,true",
                              "Bitstream",
                              "Disconnect",
                              "SubscribeToData",
                              "SubscribeByID",
                              "SubscribedDataOnly"});
  expect(Message::kUnrecognized,
         {"", ",", "framerate", "FrameRate2", "Shutdown", "service20,-1,x", "GetProperty",
          "GetProperty,,", "GetProperty,nobody,Name", "GetTakeProperty,x,y"});
}

TEST_F(CommandWordsTest, IgnoresBlanksAroundWords) {
  expect(kDone, {"StartRecording ", "DisableAsset, drone"});
  EXPECT_FALSE(enabled(2));
}

TEST_F(CommandWordsTest, RecordsOneTakeUnderTheNameThatWasSet) {
  EXPECT_EQ(number("CurrentMode"), 0);
  expect(kDone, {"SetRecordTakeName,walk,7", "StartRecording"});
  EXPECT_EQ(operator_api_.under_way, "walk");
  EXPECT_EQ(number("CurrentMode"), 1);
  EXPECT_EQ(number("StartRecording"), kRefused);
  EXPECT_EQ(text("GetTakeProperty,walk,Name"), "walk");
  expect(kDone, {"StopRecording", "StartRecording"});
  EXPECT_EQ(operator_api_.under_way, "") << "called by its date";
}

TEST_F(CommandWordsTest, FindsAssetsByNameAndById) {
  EXPECT_EQ(number("DisableAsset,drone"), kDone);
  EXPECT_FALSE(enabled(2));
  EXPECT_EQ(number("EnableAsset,2"), kDone);
  EXPECT_TRUE(enabled(2));
  EXPECT_EQ(number("EnableAsset,spare"), kDone) << "a disabled one is in no frame";
  EXPECT_TRUE(enabled(3));
  expect(kRefused, {"EnableAsset,nobody", "EnableAsset"});
  operator_api_.all[1].name = "left,arm";
  server_.announced[1].name = "left_arm";
  EXPECT_EQ(number("DisableAsset,left_arm"), kDone) << "the name that clients see";
  EXPECT_FALSE(enabled(2));
}

TEST_F(CommandWordsTest, ResettingTheOrientationMakesTheAttitudeIdentity) {
  operator_api_.all[0].X_BP = {Eigen::Quaterniond(2 / 9., 4 / 9., 5 / 9., 6 / 9.), {0.1, 0.2, 0.3}};
  const Pose X_WP = server_.frame->bodies[0].X_WP;
  const Pose X_BP = operator_api_.all[0].X_BP;
  ASSERT_EQ(number("ResetAssetOrientation,arm"), kDone);
  const Eigen::Quaterniond q_WB = X_WP.q * X_BP.q.conjugate();
  const Eigen::Quaterniond now = q_WB * operator_api_.all[0].X_BP.q;
  EXPECT_NEAR(now.angularDistance(Eigen::Quaterniond::Identity()), 0, 1e-7);
  EXPECT_EQ(operator_api_.all[0].X_BP.p, X_BP.p);
  EXPECT_EQ(number("ResetAssetLocation,arm"), kDone);
  EXPECT_EQ(operator_api_.all[0].X_BP.p, Eigen::Vector3d::Zero());
}

TEST_F(CommandWordsTest, RefusesUnsupportedChangesAndTextsOf64KiB) {
  expect(kRefused, {"RecalibrateAsset,arm", "ResetAssetOrientation,spare" /* not tracked */,
                    "SetProperty,Master Rate,180", "SetProperty,arm,Color,red"});
  const std::string name(65000, 'n');
  expect(Message::kUnrecognized, {name, "GetProperty," + name + ",Name", std::string(65000, ',')});
  expect(kRefused, {"SetRecordTakeName," + name, "EnableAsset," + name, "Bitstream," + name});
}

TEST_F(CommandWordsTest, OtherComputersMayReadOnly) {
  from_ = kElsewhere;
  expect(kRefused, {"StartRecording", "StopRecording", "SetRecordTakeName,x", "EnableAsset,arm",
                    "DisableAsset,arm", "SetProperty,arm,Name,leg", "ResetAssetOrientation,arm",
                    "ResetAssetLocation,arm"});
  EXPECT_FALSE(operator_api_.under_way);
  EXPECT_TRUE(enabled(1));
  EXPECT_EQ(operator_api_.all[0].name, "arm");
  EXPECT_EQ(text("GetProperty,arm,Name"), "arm");
  server_.config.remote_control = RemoteControl::kAll;
  EXPECT_EQ(number("StartRecording"), kDone);
}

TEST_F(CommandWordsTest, ChangesRequireThePermissionOfTheConfiguration) {
  server_.config.remote_control = NatNetConfig{}.remote_control;
  EXPECT_EQ(number("StartRecording"), kRefused);
  server_.config.remote_control = RemoteControl::kAll;
  server_.operator_api = nullptr;
  EXPECT_EQ(number("StartRecording"), kRefused);
  EXPECT_EQ(number("CurrentMode"), 0);
}

TEST_F(CommandWordsTest, ChangesToSupportedBitstreamsOfUnicastOnly) {
  EXPECT_EQ(ask("Bitstream").datagram, encode_bitstream_response({3, 1}));
  const auto answer = ask("Bitstream,4.1.0.0");
  EXPECT_EQ(number_in(answer.datagram), kDone);
  EXPECT_EQ(answer.switch_to, (Bitstream{4, 1}));
  const auto expect_refused = [&](const char* word) {
    EXPECT_EQ(number(word), kRefused) << word;
    EXPECT_FALSE(ask(word).switch_to) << word;
  };
  for (const char* word :
       {"Bitstream,255.255", "Bitstream,4.5", "Bitstream,x", "Bitstream,", "Bitstream,-1.0"}) {
    expect_refused(word);
  }
  multicast_ = true;
  expect_refused("Bitstream,4.1");
}

TEST_F(CommandWordsTest, SubscriptionsSelectBodies) {
  EXPECT_EQ(number("SubscribeToData,RigidBody,nobody"), kRefused);
  for (int id = 100; id < 200; ++id)
    EXPECT_EQ(number("SubscribeByID,RigidBody," + std::to_string(id)), kRefused);
  const Selection& selection = subscriber_.selection;
  EXPECT_EQ(selection, Selection());
  struct Step {
    const char* command;
    bool arm, drone, everything;
  };
  const Step kSteps[] = {
      {"SubscribedDataOnly", false, false, false},
      {"SubscribeToData,RigidBody,drone", false, true, false},
      {"SubscribeByID,RigidBody,1", true, true, false},
      {"SubscribeByID,RigidBody,1,None", false, true, false},
      {"SubscribeToData,RigidBody,all", false, true, false},  // one body has priority over all
      {"SubscribeToData", true, true, true},
      {"SubscribeToData,Skeleton,all", true, true, true},
      {"SubscribeToData,RigidBody,None", false, false, false},
      {"SubscribeToData,AllTypes", false, false, false}};  // the type has priority over all types
  for (const auto& [command, arm, drone, everything] : kSteps) {
    EXPECT_EQ(number(command), kDone) << command;
    EXPECT_EQ(selection.has(1), arm) << command;
    EXPECT_EQ(selection.has(2), drone) << command;
    EXPECT_EQ(selection.is_everything(), everything) << command;
  }
}

class PropertiesTest : public CommandWordsTest {
 protected:
  using Values = std::initializer_list<std::pair<const char*, const char*>>;

  void expect_values(const Values& values) {
    for (const auto& [name, value] : values) {
      const Datagram answer = ask("GetProperty," + std::string(name)).datagram;
      EXPECT_EQ(id_of(answer) == Message::kUnrecognized ? "none" : text_in(answer), value) << name;
    }
  }
  bool set(const std::string& text) { return number("SetProperty," + text) == kDone; }
};

TEST_F(PropertiesTest, OfTheServer) {
  server_.rate_hz = 240;
  expect_values({{",FrameRate", "240"},
                 {"Master Rate", "240"},
                 {",Up Axis", "Y Axis"},
                 {",bitstream", "3.1"},
                 {",Colour", "none"}});
  server_.config.up = UpAxis::kZ;
  expect_values({{",UpAxis", "Z Axis"}});
}

TEST_F(PropertiesTest, OfABodyUnderTheNameThatClientsSee) {
  expect_values({{"drone,Name", "drone"},
                 {"2,Name", "drone"},
                 {"drone,Streaming ID", "2"},
                 {"drone,Active", "true"},
                 {"spare,Active", "false"},
                 {"drone,TrackingValid", "true"},
                 {"spare,TrackingValid", "false"},
                 {"nobody,Name", "none"}});
  server_.config.aliases = {{"drone", "Rigid Body 1"}, {"spare", "Rigid Body 2"}};
  server_.announced[1].name = "Rigid Body 1";
  expect_values({{"Rigid Body 1,Name", "Rigid Body 1"},
                 {"drone,Name", "Rigid Body 1"},
                 {"Rigid Body 2,Name", "Rigid Body 2"} /* disabled */});
}

TEST_F(PropertiesTest, OnlyNameAndActiveCanBeSet) {
  EXPECT_TRUE(set("drone,Active,False"));
  EXPECT_FALSE(enabled(2));
  EXPECT_TRUE(set("2,Enabled,1"));
  EXPECT_TRUE(enabled(2));
  for (const char* no : {"drone,Active,perhaps", "drone,Streaming ID,9", ",Up Axis,Z Axis",
                         "drone,Name", "nobody,Name,x"}) {
    EXPECT_FALSE(set(no)) << no;
  }
  EXPECT_TRUE(set("drone,Name,copter"));
  EXPECT_EQ(operator_api_.all[1].name, "copter");
}

}  // namespace
}  // namespace fiducap::natnet
