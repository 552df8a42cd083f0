#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include <linux/videodev2.h>
#include <nlohmann/json.hpp>

#include "capture/recording/recording.hpp"
#include "support/simulated_camera.hpp"
#include "support/temporary_folder.hpp"
#include "tools/camera/camera_verbs.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class CamerasCommandTest : public testing::Test {
 protected:
  CamerasCommandTest() {
    camera_.offers = {{V4L2_PIX_FMT_MJPEG, {1920, 1080}, 30, 30},
                      {V4L2_PIX_FMT_MJPEG, {1280, 720}, 60, 60},
                      {V4L2_PIX_FMT_YUYV, {640, 480}, 30, 30},
                      {V4L2_PIX_FMT_SRGGB8, {640, 480}, 90, 90}};
    camera_.knobs[V4L2_CID_EXPOSURE_ABSOLUTE] = {"Exposure Time, Absolute", 1, 5000, 156};
    camera_.knobs[V4L2_CID_GAIN] = {"Gain", 0, 64, 30};
    places_.devices = folder_.path();
    places_.names = folder_.path() / "no_names";
    places_.open = [this](const std::string& device) { return open(device); };
    folder_.write("video2", "");
    folder_.write("video10", "");
    folder_.write("videofoo", "");
  }
  Expected<std::unique_ptr<v4l2::Port>> open(const std::string& device) {
    if (device.ends_with("video10"))
      return fail(ErrorCode::kUnavailable, "cannot be opened: this user may not", device);
    return camera_.open();
  }
  std::string say(bool json = false) {
    std::ostringstream out, err;
    EXPECT_EQ(run_cameras({json}, {out, err}, places_), kExitOk);
    return out.str();
  }

  TemporaryFolder folder_;
  FakeClock clock_;
  v4l2::SimulatedCamera camera_{clock_};
  CameraPlaces places_;
};

TEST_F(CamerasCommandTest, FormatsControlsAndASectionForTheConfigurationAreShown) {
  const std::string text = say();
  EXPECT_THAT(text, AllOf(HasSubstr("video2  Simulated"), HasSubstr("1280 x 720 at 60 Hz"),
                          HasSubstr("Exposure Time, Absolute = 156, 1 to 5000"),
                          HasSubstr("RGGB (not read here)"), HasSubstr("  width: 1280"),
                          HasSubstr("  exposure_s: 0.005"), HasSubstr("  gain: 30")));
}

TEST_F(CamerasCommandTest, WhatThisUserMayNotOpenIsListedWithTheReason) {
  EXPECT_THAT(say(), HasSubstr("cannot be opened: this user may not"));
}

TEST_F(CamerasCommandTest, NodesThatGiveNoImagesAreLeftOut) {
  camera_.capabilities = 0x04800000;  // metadata
  EXPECT_THAT(say(), Not(HasSubstr("video2")));
}

TEST_F(CamerasCommandTest, JsonHasEverything) {
  const auto all = nlohmann::json::parse(say(true));
  ASSERT_EQ(all["cameras"].size(), 2u);
  const auto& camera = all["cameras"][0];
  EXPECT_EQ(camera["driver"], "simulated");
  EXPECT_EQ(camera["formats"][0]["format"], "MJPEG");
  EXPECT_EQ(camera["formats"][2]["format"], nullptr);
  EXPECT_EQ(camera["controls"][0]["value"], 30);
  EXPECT_EQ(all["cameras"][1]["may_be_opened"], false);
}

TEST_F(CamerasCommandTest, WithoutACameraItSaysWhereTheyMayBe) {
  places_.devices = folder_.path() / "empty";
  EXPECT_THAT(say(), HasSubstr("No camera"));
}

/// Thirty images a second that get brighter; some are lost.
class Brightening final : public SensorSource {
 public:
  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    auto image = std::make_shared<GrayImage>();
    image->resize(64, 48);
    std::fill(image->pixels.begin(), image->pixels.end(), static_cast<std::uint8_t>(number_));
    const Instant at = instant_from_ns(5'000'000'000 + number_++ * 33'333'333LL);
    CameraFrame frame{0, at, std::move(image)};
    frame.lost_before = number_ == 10;
    return frame;
  }

 private:
  int number_{0};
};

class CaptureCommandTest : public testing::Test {
 protected:
  int run() {
    const Terminal terminal{out_, err_};
    arguments_.camera.open = "/dev/video0";
    arguments_.out = (folder_.path() / "taken").string();
    return run_capture(arguments_, terminal, [](const CameraDeviceConfig&, const CameraModel&) {
      return std::unique_ptr<SensorSource>(std::make_unique<Brightening>());
    });
  }

  TemporaryFolder folder_;
  CaptureArguments arguments_;
  std::ostringstream out_, err_;
};

TEST_F(CaptureCommandTest, PicturesAreTakenAtIntervals) {
  arguments_.pictures = 3;
  arguments_.every_s = 0.5;
  arguments_.json = true;
  ASSERT_EQ(run(), kExitOk) << err_.str();
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / "taken/picture_0003.png"));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "taken/picture_0004.png"));
  const auto said = nlohmann::json::parse(out_.str());
  EXPECT_EQ(said["pictures"], 3);
  EXPECT_EQ(said["images_lost"], 1);
  EXPECT_NEAR(said["rate_hz"], 30, 0.01);
}

TEST_F(CaptureCommandTest, ARecordingIsReadBackWithItsStamps) {
  arguments_.seconds = 1;
  ASSERT_EQ(run(), kExitOk) << err_.str();
  EXPECT_THAT(out_.str(), HasSubstr("its lens is a guess"));
  const auto info = read_recording_info(arguments_.out);
  ASSERT_TRUE(info) << info.error().text();
  EXPECT_EQ(info->cameras[0].model.width, 64);
  const auto source = open_recording(*info, {}, FakeClock{});
  ASSERT_TRUE(source) << source.error().text();
  int images = 0;
  for (auto sample = (*source)->next({}); sample && *sample; sample = (*source)->next({}))
    EXPECT_EQ(time_of(**sample), instant_from_ns(5'000'000'000 + images++ * 33'333'333LL));
  EXPECT_EQ(images, 32);
}

TEST_F(CaptureCommandTest, AFolderWithContentIsNotTouched) {
  arguments_.pictures = 1;
  std::filesystem::create_directories(folder_.path() / "taken/mine");
  EXPECT_EQ(run(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("has content already"));
}

TEST_F(CaptureCommandTest, NothingOrBothToTakeIsRefused) {
  EXPECT_EQ(run(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("either --pictures N or --seconds S"));
}

}  // namespace
}  // namespace fiducap
