#include "streaming/qualisys/control.hpp"

#include <gmock/gmock.h>

#include "fake_operator_api.hpp"

namespace fiducap::qualisys {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using State = RecordingStatus::State;

constexpr Control::ClientId kAnna = 1;
constexpr Control::ClientId kBert = 2;
constexpr std::string_view kToken = "open sesame";

class QualisysControl : public testing::Test {
 protected:
  void anna_is_master() { ASSERT_TRUE(control_.take(kAnna, "anna", kToken).ok); }
  std::string say(Control::ClientId client, std::string_view command) {
    const auto reply = control_.execute(client, split_command(command));
    return !reply ? "?" : (reply->ok ? "+" : "-") + reply->text;
  }
  std::vector<Event> events() {
    std::vector<Event> out;
    control_.observe(out);
    return out;
  }
  void record_and_stop() {
    EXPECT_EQ(say(kAnna, "start"), "+Starting measurement");
    EXPECT_THAT(events(), ElementsAre(Event::kCaptureStarted));
    EXPECT_EQ(say(kAnna, "stop"), "+Stopping measurement");
  }
  FakeOperatorApi operator_api_;
  Control control_{&operator_api_};
};

TEST_F(QualisysControl, RequiresAnOperatorApiAndItsToken) {
  EXPECT_EQ(control_.take(kAnna, "anna", "").text, "Wrong or missing password");
  EXPECT_EQ(control_.take(kAnna, "anna", "open").text, "Wrong or missing password");
  EXPECT_FALSE(control_.is_master(kAnna));
  EXPECT_EQ(control_.take(kAnna, "anna", kToken).text, "You are now master");
  EXPECT_TRUE(control_.is_master(kAnna));
  Control closed(nullptr);
  EXPECT_EQ(closed.take(kAnna, "anna", kToken).text, "Client control disabled in QTM");
  EXPECT_EQ(closed.state(), Event::kConnected);
  std::vector<Event> events;
  closed.observe(events);
  EXPECT_TRUE(events.empty());
}

TEST_F(QualisysControl, HasOneMasterAtATimeUntilItLeaves) {
  anna_is_master();
  EXPECT_EQ(control_.take(kAnna, "anna", "").text, "You are already master");
  EXPECT_EQ(control_.take(kBert, "bert", kToken).text, "anna is already master");
  EXPECT_EQ(control_.release(kBert).text, "You are already a regular client");
  EXPECT_EQ(control_.release(kAnna).text, "You are now a regular client");
  EXPECT_TRUE(control_.take(kBert, "bert", kToken).ok);
  control_.left(kAnna);
  EXPECT_TRUE(control_.is_master(kBert));
  control_.left(kBert);
  EXPECT_TRUE(control_.take(kAnna, "anna", kToken).ok);
}

TEST_F(QualisysControl, RefusesCommandsOfOtherClients) {
  for (const char* command : {"New", "Close", "Start", "Stop", "Save x", "Load x", "Trig",
                              "Calibrate", "Reprocess", "SetQTMEvent x", "LoadProject x"}) {
    EXPECT_EQ(say(kBert, command), "-You must be master to issue this command") << command;
  }
  EXPECT_FALSE(operator_api_.under_way);
}

TEST_F(QualisysControl, RecordsACaptureAndReportsItsNameWhenSaved) {
  anna_is_master();
  EXPECT_EQ(say(kAnna, "new"), "+Already connected");
  EXPECT_EQ(say(kAnna, "stop"), "-No measurement is running");
  EXPECT_EQ(say(kAnna, "save take"), "-No measurement to save");
  EXPECT_EQ(say(kAnna, "close"), "+No connection to close");
  EXPECT_EQ(say(kAnna, "start"), "+Starting measurement");
  EXPECT_TRUE(operator_api_.under_way);
  EXPECT_EQ(control_.state(), Event::kCaptureStarted);
  EXPECT_EQ(say(kAnna, "start"), "-Measurement is already running");
  EXPECT_EQ(say(kAnna, "close"), "-Measurement is already running");
  EXPECT_EQ(say(kAnna, "stop"), "+Stopping measurement");
  EXPECT_FALSE(operator_api_.under_way);
  EXPECT_EQ(say(kAnna, "save take"), "+Measurement saved as 'take_1'");
  EXPECT_EQ(say(kAnna, "close"), "+Closing file");
  EXPECT_EQ(say(kAnna, "save take"), "-No measurement to save");
}

TEST_F(QualisysControl, DoesNotSaveACaptureThatFailed) {
  anna_is_master();
  record_and_stop();
  operator_api_.known = {{"take_1", State::kFailed, "the disk is full", 10, 2000, 3}};
  EXPECT_THAT(events(), ElementsAre(Event::kCaptureStopped, Event::kConnected));
  EXPECT_EQ(say(kAnna, "save take"), "-Failed to save measurement");
  EXPECT_EQ(say(kAnna, "stop"), "-The measurement failed: the disk is full");
  operator_api_.known.push_back({"take_2", State::kFinished, "", 10, 2000, 0});
  EXPECT_EQ(say(kAnna, "stop"), "-No measurement is running");
}

TEST_F(QualisysControl, DoesNotSaveACaptureBeforeItIsOnDisk) {
  anna_is_master();
  operator_api_.stops_as = State::kStopping;
  record_and_stop();
  EXPECT_THAT(events(), ElementsAre(Event::kCaptureStopped));
  EXPECT_EQ(say(kAnna, "save take"), "-Failed to save measurement");
  EXPECT_THAT(events(), IsEmpty());
  operator_api_.known.back().state = State::kFinished;
  EXPECT_THAT(events(), ElementsAre(Event::kCaptureSaved, Event::kConnected));
  EXPECT_EQ(say(kAnna, "save take"), "+Measurement saved as 'take_1'");
}

TEST_F(QualisysControl, ReportsWhyACommandIsImpossible) {
  anna_is_master();
  operator_api_.disk_full = true;
  EXPECT_EQ(say(kAnna, "Start"), "-the disk is full");
  EXPECT_EQ(say(kAnna, "Start RTFromFile"), "-No file open");
  EXPECT_EQ(say(kAnna, "Load x"), "-Failed to load measurement");
  EXPECT_EQ(say(kAnna, "LoadProject x"), "-Failed to load project");
  EXPECT_EQ(say(kAnna, "Trig"), "-QTM not waiting for trig");
  EXPECT_EQ(say(kAnna, "Event x"), "-QTM is not capturing");
  EXPECT_EQ(say(kBert, "GetCaptureC3D"), "-No capture to get");
  EXPECT_EQ(say(kAnna, "Dance"), "?");
}

TEST_F(QualisysControl, ReportsRecordingsOfOtherProtocolsOnce) {
  EXPECT_THAT(events(), IsEmpty());
  operator_api_.under_way = "by the page";
  EXPECT_THAT(events(), ElementsAre(Event::kCaptureStarted));
  EXPECT_THAT(events(), IsEmpty());
  ASSERT_TRUE(operator_api_.stop_recording({}));
  EXPECT_THAT(events(),
              ElementsAre(Event::kCaptureStopped, Event::kCaptureSaved, Event::kConnected));
  EXPECT_EQ(control_.state(), Event::kConnected);
}

TEST_F(QualisysControl, SettingsOfTheMasterEnableBodies) {
  const std::vector<BodyTable::Entry> bodies{{7, "arm", true}, {9, "drone", true}};
  const auto apply = [&](const std::string& xml) {
    return control_.apply_settings(kAnna, xml, bodies);
  };
  const auto switched = [&](const char* name, const char* on) {
    return apply("<S><The_6D><Body><Name>" + std::string(name) + "</Name><Enabled>" + on +
                 "</Enabled></Body></The_6D></S>");
  };
  EXPECT_FALSE(switched("arm", "false").ok);
  anna_is_master();
  EXPECT_EQ(switched("arm", "false").text, "Setting parameters succeeded");
  EXPECT_EQ(operator_api_.enabled, (std::map<int, bool>{{7, false}}));
  EXPECT_TRUE(switched("drone", "true").ok);  // it is
  EXPECT_EQ(operator_api_.enabled.size(), 1u);
  EXPECT_EQ(switched("ghost", "true").text, "Setting parameters failed");
  EXPECT_FALSE(apply("<S><General/></S>").ok);
  EXPECT_FALSE(apply("<S").ok);
}

}  // namespace
}  // namespace fiducap::qualisys
