#include "capture/v4l2/controls.hpp"

#include <gmock/gmock.h>

#include <linux/videodev2.h>

#include "support/simulated_camera.hpp"

namespace fiducap::v4l2 {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class SettingsTest : public testing::Test {
 protected:
  SettingsTest() {
    camera_.offers = {{V4L2_PIX_FMT_GREY, {64, 48}, 60, 60}};
    const auto automatic = [](const char* name) {
      return SimulatedCamera::Knob{name, 0, 1, 1, V4L2_CTRL_TYPE_BOOLEAN};
    };
    const auto menu = [](const char* name, int value, std::set<std::int32_t> choices) {
      const int last = *choices.rbegin();
      return SimulatedCamera::Knob{name, 0, last, value, V4L2_CTRL_TYPE_MENU, 1, choices};
    };
    camera_.knobs = {
        {V4L2_CID_EXPOSURE_AUTO, menu("Auto Exposure", 3, {1, 3})},
        {V4L2_CID_EXPOSURE_ABSOLUTE, {"Exposure Time, Absolute", 1, 2000, 156}},
        {V4L2_CID_GAIN, {"Gain", 0, 64, 30, V4L2_CTRL_TYPE_INTEGER, 4}},
        {V4L2_CID_AUTO_WHITE_BALANCE, automatic("White Balance, Automatic")},
        {V4L2_CID_WHITE_BALANCE_TEMPERATURE, {"White Balance Temperature", 2800, 6500, 4600}},
        {V4L2_CID_FOCUS_AUTO, automatic("Focus, Automatic Continuous")},
        {V4L2_CID_FOCUS_ABSOLUTE, {"Focus, Absolute", 0, 250, 100}},
        {V4L2_CID_POWER_LINE_FREQUENCY, menu("Power Line Frequency", 2, {0, 1, 2})}};
    port_ = camera_.open();
  }
  SettingsReport apply() { return apply_settings(*port_, config_); }
  std::int32_t value(std::uint32_t id) { return camera_.knobs.at(id).value; }

  FakeClock clock_;
  SimulatedCamera camera_{clock_};
  std::unique_ptr<Port> port_;
  CameraDeviceConfig config_;
};

TEST_F(SettingsTest, ChangesNothingByDefault) {
  const SettingsReport report = apply();
  EXPECT_THAT(report.done, IsEmpty());
  EXPECT_THAT(report.undone, IsEmpty());
  EXPECT_THAT(camera_.set, IsEmpty());
}

TEST_F(SettingsTest, SetsAndReadsBackWhatIsConfigured) {
  config_.exposure_s = 0.008;
  config_.gain = "12";
  config_.white_balance = "4000";
  config_.focus = "0";
  config_.power_line = "50";
  const SettingsReport report = apply();
  EXPECT_THAT(report.done, ElementsAre("power_line 50", "exposure_s 0.008", "gain 12",
                                       "white_balance 4000", "focus 0"));
  EXPECT_THAT(report.undone, IsEmpty());
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_ABSOLUTE), 80);
  EXPECT_EQ(value(V4L2_CID_AUTO_WHITE_BALANCE), 0) << "else the number would mean nothing";
  EXPECT_EQ(value(V4L2_CID_FOCUS_AUTO), 0);
  EXPECT_EQ(value(V4L2_CID_POWER_LINE_FREQUENCY), 1);
}

TEST_F(SettingsTest, ReportsValuesThatTheDeviceChanged) {
  config_.exposure_s = 0.5;
  config_.gain = "13";
  const SettingsReport report = apply();
  EXPECT_THAT(report.undone,
              ElementsAre("exposure_s is 0.2, not 0.5 as requested: the range is 0.0001 to 0.2",
                          "gain is 12, not 13 as requested: its control \"Gain\" accepts 0 to 64"));
}

TEST_F(SettingsTest, EnablesAutomaticModes) {
  camera_.knobs[V4L2_CID_EXPOSURE_AUTO].value = V4L2_EXPOSURE_MANUAL;
  camera_.knobs[V4L2_CID_EXPOSURE_AUTO_PRIORITY] = {"Exposure, Dynamic Framerate", 0, 1, 1,
                                                    V4L2_CTRL_TYPE_BOOLEAN};
  config_.exposure = ExposureMode::kAuto;
  config_.focus = "auto";
  EXPECT_THAT(apply().done, ElementsAre("exposure auto", "focus auto"));
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_APERTURE_PRIORITY);
  EXPECT_EQ(value(V4L2_CID_EXPOSURE_AUTO_PRIORITY), 0) << "the rate stays in the dark";
}

TEST_F(SettingsTest, ReportsControlsThatAreMissing) {
  config_.gain = "auto";
  config_.trigger = "on";
  camera_.knobs.erase(V4L2_CID_EXPOSURE_ABSOLUTE);
  camera_.knobs[V4L2_CID_EXPOSURE] = {"Exposure", 1, 1000, 500};
  config_.exposure_s = 0.005;
  const auto undone = apply().undone;
  ASSERT_EQ(undone.size(), 3u);
  EXPECT_THAT(undone[0], HasSubstr("none of its controls has \"trigger\" in its name"));
  EXPECT_THAT(undone[1], HasSubstr("in lines of the sensor, not in time"));
  EXPECT_THAT(undone[2], HasSubstr("gain auto was requested, but it has no automatic mode for it"));
}

TEST_F(SettingsTest, FindsATriggerByItsName) {
  camera_.knobs[0x00980fff] = {"Ext TRIGGER mode", 0, 3, 0};
  config_.trigger = "2";
  EXPECT_THAT(apply().done, ElementsAre("trigger 2"));
  EXPECT_EQ(value(0x00980fff), 2);
}

TEST_F(SettingsTest, ReadsTheExposureInTimeOrInLines) {
  EXPECT_EQ(read_exposure(*port_).time, std::chrono::microseconds(15'600));
  EXPECT_TRUE(read_exposure(*port_).is_automatic);
  camera_.knobs.erase(V4L2_CID_EXPOSURE_ABSOLUTE);
  EXPECT_FALSE(read_exposure(*port_).is_in_lines);
  camera_.knobs[V4L2_CID_EXPOSURE] = {"Exposure", 1, 1000, 500};
  EXPECT_FALSE(read_exposure(*port_).time);
  EXPECT_TRUE(read_exposure(*port_).is_in_lines);
}

}  // namespace
}  // namespace fiducap::v4l2
