#include <gmock/gmock.h>

#include <linux/videodev2.h>
#include <nlohmann/json.hpp>

#include "capture/recording/recording.hpp"
#include "support/command_run.hpp"
#include "support/results.hpp"
#include "support/simulated_camera.hpp"
#include "support/temporary_folder.hpp"
#include "tools/camera/camera_verbs.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

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
    places_.open = [this](const std::string& device) -> Expected<std::unique_ptr<v4l2::Port>> {
      if (device.ends_with("video10"))
        return fail(ErrorCode::kUnavailable, "cannot be opened: this user may not", device);
      return camera_.open();
    };
    for (const char* name : {"video2", "video10", "videofoo"}) folder_.write(name, "");
  }
  [[nodiscard]] std::string list(bool json = false) const {
    const auto run =
        on_terminal([&](const Terminal& t) { return run_cameras({json}, t, places_); });
    EXPECT_EQ(run.code, kExitOk);
    return run.out;
  }

  TemporaryFolder folder_;
  FakeClock clock_;
  v4l2::SimulatedCamera camera_{clock_};
  CameraPlaces places_;
};

TEST_F(CamerasCommandTest, ListsFormatsControlsAndConfiguration) {
  EXPECT_THAT(list(),
              testing::AllOf(HasSubstr("video2  Simulated"), HasSubstr("1280 x 720 at 60 Hz"),
                             HasSubstr("Exposure Time, Absolute = 156, 1 to 5000"),
                             HasSubstr("RGGB (not read here)"), HasSubstr("  width: 1280"),
                             HasSubstr("  exposure_s: 0.005"), HasSubstr("  gain: 30"),
                             HasSubstr("cannot be opened: this user may not")));
}

TEST_F(CamerasCommandTest, OmitsNodesWithoutImages) {
  camera_.capabilities = 0x04800000;  // metadata
  EXPECT_THAT(list(), testing::Not(HasSubstr("video2")));
  places_.devices = folder_.path() / "empty";
  EXPECT_THAT(list(), HasSubstr("No camera"));
}

TEST_F(CamerasCommandTest, JsonIsComplete) {
  const auto all = nlohmann::json::parse(list(true));
  ASSERT_EQ(all["cameras"].size(), 2u);
  const auto& camera = all["cameras"][0];
  EXPECT_EQ(camera["driver"], "simulated");
  EXPECT_EQ(camera["formats"][0]["format"], "MJPEG");
  EXPECT_EQ(camera["formats"][2]["format"], nullptr);
  EXPECT_EQ(camera["controls"][0]["value"], 30);
  EXPECT_EQ(all["cameras"][1]["may_be_opened"], false);
}

Instant stamp_of(int image) { return instant_from_ns(5'000'000'000 + image * 33'333'333LL); }

/// Thirty images per second with rising brightness; some are lost.
class Brightening final : public SensorSource {
 public:
  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    auto image = std::make_shared<GrayImage>();
    image->resize(64, 48);
    std::fill(image->pixels.begin(), image->pixels.end(), static_cast<std::uint8_t>(number_));
    CameraFrame frame{0, stamp_of(number_++), std::move(image)};
    frame.lost_before = number_ == 10;
    return frame;
  }

 private:
  int number_{0};
};

class CaptureCommandTest : public testing::Test {
 protected:
  CommandRun run() {
    arguments_.camera.open = "/dev/video0";
    arguments_.out = folder_.file("taken");
    return on_terminal([&](const Terminal& terminal) {
      return run_capture(arguments_, terminal, [](const CameraDeviceConfig&, const CameraModel&) {
        return std::unique_ptr<SensorSource>(std::make_unique<Brightening>());
      });
    });
  }

  TemporaryFolder folder_;
  CaptureArguments arguments_;
};

TEST_F(CaptureCommandTest, SavesPicturesAtIntervals) {
  arguments_.pictures = 3;
  arguments_.every_s = 0.5;
  arguments_.json = true;
  const auto taken = run();
  ASSERT_EQ(taken.code, kExitOk) << taken.err;
  EXPECT_TRUE(std::filesystem::exists(folder_.file("taken/picture_0003.png")));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("taken/picture_0004.png")));
  const auto json = nlohmann::json::parse(taken.out);
  EXPECT_EQ(json["pictures"], 3);
  EXPECT_EQ(json["images_lost"], 1);
  EXPECT_NEAR(json["rate_hz"], 30, 0.01);
}

TEST_F(CaptureCommandTest, RecordingKeepsTheStamps) {
  arguments_.seconds = 1;
  const auto taken = run();
  ASSERT_EQ(taken.code, kExitOk) << taken.err;
  EXPECT_THAT(taken.out, HasSubstr("its lens is a guess"));
  const auto info = value_of(read_recording_info(arguments_.out));
  EXPECT_EQ(info.cameras[0].model.width, 64);
  const auto source = value_of(open_recording(info, {}, FakeClock{}));
  int images = 0;
  for (auto sample = source->next({}); sample && *sample; sample = source->next({}))
    EXPECT_EQ(time_of(**sample), stamp_of(images++));
  EXPECT_EQ(images, 32);
}

TEST_F(CaptureCommandTest, RefusesUsedFoldersAndUnclearOrders) {
  const auto unclear = run();
  EXPECT_EQ(unclear.code, kExitFailed);
  EXPECT_THAT(unclear.err, HasSubstr("either --pictures N or --seconds S"));
  arguments_.pictures = 1;
  std::filesystem::create_directories(folder_.file("taken/mine"));
  const auto used = run();
  EXPECT_EQ(used.code, kExitFailed);
  EXPECT_THAT(used.err, HasSubstr("has content already"));
}

}  // namespace
}  // namespace fiducap
