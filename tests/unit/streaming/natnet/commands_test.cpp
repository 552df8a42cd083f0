#include <gtest/gtest.h>

#include "fake_operator_api.hpp"
#include "messages.hpp"
#include "streaming/natnet/commands.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {
namespace {

constexpr std::int32_t kDone = 0;
constexpr std::int32_t kRefused = 1;
constexpr Peer kHere{0x7f000001, 4000};
constexpr Peer kElsewhere{0x0a000001, 4000};

class CommandWordsTest : public testing::Test {
 protected:
  CommandWordsTest() {
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
  std::string text(std::string_view question) {
    const auto answer = ask(question).datagram;
    return id_of(answer) == Message::kUnrecognized ? "unrecognized" : text_in(answer);
  }

  FakeOperatorApi operator_api_;
  ServerView server_;
  CommandWords words_;
  Subscriber subscriber_;
  Peer from_{kHere};
  bool multicast_{false};
};

TEST_F(CommandWordsTest, FactsAreNumbers) {
  EXPECT_EQ(ask("FrameRate").datagram, encode_response(120.0F));
  EXPECT_EQ(ask("UnitsToMillimeters").datagram, encode_response(1000.0F));
  EXPECT_EQ(number("AnalogSamplesPerMocapFrame"), 0);
  EXPECT_EQ(number("CurrentTakeLength"), 0);
  EXPECT_EQ(text("CurrentSessionPath"), "/");
}

TEST_F(CommandWordsTest, EveryWordThatClientsAreKnownToSendIsAnswered) {
  for (const char* word : {"UnitsToMillimeters",
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
                           "SubscribedDataOnly"}) {
    EXPECT_EQ(id_of(ask(word).datagram), Message::kResponse) << word;
  }
}

TEST_F(CommandWordsTest, AnythingElseIsUnrecognized) {
  for (const char* word :
       {"", ",", "framerate", "FrameRate2", "Shutdown", "service20,-1,x", "GetProperty",
        "GetProperty,,", "GetProperty,nobody,Name", "GetTakeProperty,x,y"}) {
    EXPECT_EQ(id_of(ask(word).datagram), Message::kUnrecognized) << word;
  }
}

TEST_F(CommandWordsTest, BlanksAroundWordsDoNotCount) {
  EXPECT_EQ(number("StartRecording "), kDone);
  EXPECT_EQ(number("DisableAsset, drone"), kDone);
  EXPECT_FALSE(operator_api_.find(2)->enabled);
}

TEST_F(CommandWordsTest, ARecordingHasTheNameThatWasSetForIt) {
  EXPECT_EQ(number("CurrentMode"), 0);
  EXPECT_EQ(number("SetRecordTakeName,walk,7"), kDone);
  EXPECT_EQ(number("StartRecording"), kDone);
  EXPECT_EQ(operator_api_.take, "walk");
  EXPECT_EQ(number("CurrentMode"), 1);
  EXPECT_EQ(number("StartRecording"), kRefused);
  EXPECT_EQ(text("GetTakeProperty,walk,Name"), "walk");
  EXPECT_EQ(number("StopRecording"), kDone);
  EXPECT_EQ(number("StopRecording"), kRefused);
  EXPECT_EQ(number("StartRecording"), kDone);
  EXPECT_EQ(operator_api_.takes, (std::vector<std::string>{"walk", "by date"}))
      << "one name, one take";
}

TEST_F(CommandWordsTest, AssetsAreFoundByNameAndById) {
  EXPECT_EQ(number("DisableAsset,drone"), kDone);
  EXPECT_FALSE(operator_api_.find(2)->enabled);
  EXPECT_EQ(number("EnableAsset,2"), kDone);
  EXPECT_TRUE(operator_api_.find(2)->enabled);
  EXPECT_EQ(number("EnableAsset,spare"), kDone)
      << "a disabled one is in no frame, and yet must be found";
  EXPECT_TRUE(operator_api_.find(3)->enabled);
  EXPECT_EQ(number("EnableAsset,nobody"), kRefused);
  EXPECT_EQ(number("EnableAsset"), kRefused);
}

TEST_F(CommandWordsTest, AssetsAreFoundByTheNameThatClientsSee) {
  operator_api_.all[1].name = "left,arm";
  server_.announced[1].name = "left_arm";
  EXPECT_EQ(number("DisableAsset,left_arm"), kDone);
  EXPECT_FALSE(operator_api_.find(2)->enabled);
}

TEST_F(CommandWordsTest, ResettingTheOrientationMakesTheAttitudeOne) {
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

TEST_F(CommandWordsTest, WhatHasNoMeaningHereIsRefusedCleanly) {
  EXPECT_EQ(number("RecalibrateAsset,arm"), kRefused);
  EXPECT_EQ(number("ResetAssetOrientation,spare"), kRefused) << "not tracked";
  EXPECT_EQ(number("SetProperty,Master Rate,180"), kRefused);
  EXPECT_EQ(number("SetProperty,arm,Color,red"), kRefused);
}

TEST_F(CommandWordsTest, OthersMayLookButNotTouch) {
  from_ = kElsewhere;
  for (const char* word : {"StartRecording", "StopRecording", "SetRecordTakeName,x",
                           "EnableAsset,arm", "DisableAsset,arm", "SetProperty,arm,Name,leg",
                           "ResetAssetOrientation,arm", "ResetAssetLocation,arm"}) {
    EXPECT_EQ(number(word), kRefused) << word;
  }
  EXPECT_TRUE(operator_api_.takes.empty());
  EXPECT_TRUE(operator_api_.all[0].enabled);
  EXPECT_EQ(operator_api_.all[0].name, "arm");
  EXPECT_EQ(text("GetProperty,arm,Name"), "arm");
  server_.config.remote_control = RemoteControl::kAll;
  EXPECT_EQ(number("StartRecording"), kDone);
}

TEST_F(CommandWordsTest, WithoutThePermissionOfTheConfigurationNothingChanges) {
  server_.config.remote_control = NatNetConfig{}.remote_control;
  EXPECT_EQ(number("StartRecording"), kRefused);
  server_.config.remote_control = RemoteControl::kAll;
  server_.operator_api = nullptr;
  EXPECT_EQ(number("StartRecording"), kRefused);
  EXPECT_EQ(number("CurrentMode"), 0);
}

TEST_F(CommandWordsTest, ReportsAndSwitchesTheBitstream) {
  EXPECT_EQ(ask("Bitstream").datagram, encode_bitstream_response({3, 1}));
  const auto answer = ask("Bitstream,4.1.0.0");
  EXPECT_EQ(number_in(answer.datagram), kDone);
  EXPECT_EQ(answer.switch_to, (Bitstream{4, 1}));
}

TEST_F(CommandWordsTest, BitstreamsThatWeDoNotHaveAreRefused) {
  for (const char* word :
       {"Bitstream,255.255", "Bitstream,4.3", "Bitstream,x", "Bitstream,", "Bitstream,-1.0"}) {
    const auto answer = ask(word);
    EXPECT_EQ(number_in(answer.datagram), kRefused) << word;
    EXPECT_FALSE(answer.switch_to) << word;
  }
}

TEST_F(CommandWordsTest, MulticastFramesAreOneForAll) {
  multicast_ = true;
  const auto answer = ask("Bitstream,4.1");
  EXPECT_EQ(number_in(answer.datagram), kRefused);
  EXPECT_FALSE(answer.switch_to);
}

TEST_F(CommandWordsTest, SubscriptionsChooseBodies) {
  EXPECT_EQ(number("SubscribedDataOnly"), kDone);
  EXPECT_FALSE(subscriber_.selection.has(1));
  EXPECT_EQ(number("SubscribeToData,RigidBody,drone"), kDone);
  EXPECT_TRUE(subscriber_.selection.has(2));
  EXPECT_FALSE(subscriber_.selection.has(1));
  EXPECT_EQ(number("SubscribeByID,RigidBody,1"), kDone);
  EXPECT_TRUE(subscriber_.selection.has(1));
  EXPECT_EQ(number("SubscribeByID,RigidBody,1,None"), kDone);
  EXPECT_FALSE(subscriber_.selection.has(1));
  EXPECT_EQ(number("SubscribeToData,RigidBody,all"), kDone);
  EXPECT_FALSE(subscriber_.selection.has(1)) << "one body is stronger than all";
  EXPECT_EQ(number("SubscribeToData"), kDone);
  EXPECT_TRUE(subscriber_.selection.is_everything());
}

TEST_F(CommandWordsTest, SubscriptionsCanLeaveOut) {
  EXPECT_EQ(number("SubscribeToData,RigidBody,None"), kDone);
  EXPECT_FALSE(subscriber_.selection.has(1));
  EXPECT_EQ(number("SubscribeToData,AllTypes"), kDone);
  EXPECT_FALSE(subscriber_.selection.has(1)) << "the type is stronger than all types";
}

TEST_F(CommandWordsTest, OfOtherTypesThereIsNothing) {
  EXPECT_EQ(number("SubscribeToData,Skeleton,all"), kDone);
  EXPECT_TRUE(subscriber_.selection.is_everything());
}

TEST_F(CommandWordsTest, RefusesASubscriptionToAnUnknownBodyWithoutState) {
  EXPECT_EQ(number("SubscribeToData,RigidBody,nobody"), kRefused);
  for (int id = 100; id < 200; ++id)
    EXPECT_EQ(number("SubscribeByID,RigidBody," + std::to_string(id)), kRefused);
  EXPECT_EQ(subscriber_.selection, Selection());
}

TEST_F(CommandWordsTest, DisconnectIsAnsweredAndLeaves) {
  const auto answer = ask("Disconnect");
  EXPECT_EQ(number_in(answer.datagram), kDone);
  EXPECT_TRUE(answer.leaves);
}

TEST_F(CommandWordsTest, SixtyFourKilobytesAreJustAnotherWord) {
  const std::string name(65000, 'n');
  EXPECT_EQ(id_of(ask(name).datagram), Message::kUnrecognized);
  EXPECT_EQ(number("SetRecordTakeName," + name), kRefused);
  EXPECT_EQ(number("SetProperty,arm,Name," + name), kRefused);
  EXPECT_EQ(number("EnableAsset," + name), kRefused);
  EXPECT_EQ(id_of(ask("GetProperty," + name + ",Name").datagram), Message::kUnrecognized);
  EXPECT_EQ(number("Bitstream," + name), kRefused);
  EXPECT_EQ(id_of(ask(std::string(65000, ',')).datagram), Message::kUnrecognized);
}

class PropertiesTest : public testing::Test {
 protected:
  PropertiesTest() {
    server_.operator_api = &operator_api_;
    server_.rate_hz = 240;
    server_.frame = make_scene_frame({"arm", "drone"});
    server_.model = server_.frame->model;
    server_.announced = server_.model->bodies;
  }
  std::string get(std::string_view text) {
    return get_property(parse_command(text), server_).value_or("none");
  }
  bool set(std::string_view text) { return set_property(parse_command(text), server_).has_value(); }

  FakeOperatorApi operator_api_;
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
  EXPECT_FALSE(operator_api_.find(2)->enabled);
  EXPECT_TRUE(set("SetProperty,2,Enabled,1"));
  EXPECT_TRUE(operator_api_.find(2)->enabled);
  EXPECT_TRUE(set("SetProperty,drone,Name,copter"));
  EXPECT_EQ(operator_api_.find(2)->name, "copter");
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
