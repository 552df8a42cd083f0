#include "daemon/views/camera_preview.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"
#include "unit/detection/drawn_tag.hpp"

namespace fiducap {
namespace {

using Json = nlohmann::json;

constexpr Instant at_ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

/// A body with one camera, its worker's part, and the preview; no threads.
class CameraPreviewTest : public testing::Test {
 protected:
  CameraPreviewTest() {
    CameraMount mount;
    mount.model = {640, 480, 460, 460, 319.5, 239.5, Distortion::kNone, {}};
    setup_.sensors.cameras = {mount};
    views_.emplace(preview_.add(7, setup_.sensors));
    auto drawn = white_wall();
    draw_tag(drawn, 4, 100, 100, 20);
    draw_square(drawn, 420, 300, 60, 40);
    image_ = std::make_shared<const GrayImage>(std::move(drawn));
  }

  void expose(int ms, bool with_pixels = true) {
    SensorSample sample = CameraFrame{0, at_ms(ms), image_};
    if (!with_pixels) sample = CornerFrame{0, at_ms(ms), {}};
    // Alone, so that it does not wait for the next one.
    pipeline_.emplace(setup_);
    ASSERT_TRUE(pipeline_->push(std::move(sample)));
    pipeline_->finish();
    const MapView view{std::make_shared<const TagMap>()};
    while (const SensorSample* due = pipeline_->next()) {
      views_->note(*due);
      if (const BodyUpdate* update = pipeline_->take(view))
        views_->show(*pipeline_, *update, *view.map);
    }
  }
  /// Exposes, makes, takes. @return the message, or nullptr
  CameraViews::Picture look(int ms, bool with_pixels = true) {
    expose(ms, with_pixels);
    preview_.make_pictures();
    return preview_.take(0);
  }
  static Json header(const std::string& message) {
    return Json::parse(message.substr(
        4, static_cast<unsigned char>(message[0]) | static_cast<unsigned char>(message[1]) << 8));
  }
  void watch() { preview_.watch(0, ViewRequest{320, 10, false}); }

  FakeClock clock_{at_ms(60'000)};
  PipelineSetup setup_;
  CameraPreview preview_{TagSetConfig{}, DetectorConfig{}, clock_};
  std::optional<BodyViews> views_;
  std::optional<BodyPipeline> pipeline_;
  std::shared_ptr<const GrayImage> image_;
};

TEST_F(CameraPreviewTest, MakesAPictureOfAWatchedCamera) {
  EXPECT_EQ(preview_.cameras().size(), 1u);
  watch();
  const auto picture = look(1000);
  ASSERT_TRUE(picture);
  const Json shown = header(*picture);
  EXPECT_EQ(shown["body"], 7);
  EXPECT_EQ(shown["width"], 640);
  EXPECT_EQ(shown["shown"], Json::parse("[320, 240]"));
  EXPECT_EQ(shown["outlines"][0]["id"], 4);
  EXPECT_EQ(shown["blur"]["tags"], 1);
  EXPECT_FALSE(shown["candidates"]);
  const auto jpeg = picture->find("\xff\xd8\xff");
  ASSERT_NE(jpeg, std::string::npos);
  EXPECT_EQ(picture->substr(picture->size() - 2), "\xff\xd9") << "a whole JPEG";
  EXPECT_EQ(preview_.take(0), nullptr) << "each picture once";
}

TEST_F(CameraPreviewTest, ShowsCandidatesOnRequest) {
  preview_.watch(0, ViewRequest{640, 10, true});
  const auto picture = look(1000);
  ASSERT_TRUE(picture);
  const Json shown = header(*picture);
  EXPECT_TRUE(shown["candidates"]);
  EXPECT_EQ(shown["outlines"][0]["kind"], "candidate");
  EXPECT_EQ(shown["outlines"][0]["why"], "unread");
}

TEST_F(CameraPreviewTest, ShowsOutlinesWithoutPixels) {
  preview_.watch(0, ViewRequest{});
  const auto message = look(1000, false);
  ASSERT_TRUE(message);
  EXPECT_TRUE(header(*message)["exposure"].is_null());
  EXPECT_EQ(message->find("\xff\xd8\xff"), std::string::npos);
}

TEST_F(CameraPreviewTest, LimitsTheRateOfPictures) {
  preview_.watch(0, ViewRequest{320, 2, false});
  int made = 0;
  for (int i = 0; i < 40; ++i) made += look(1000 + 50 * i) ? 1 : 0;  // 20 Hz for two seconds
  EXPECT_EQ(made, 4);
}

TEST_F(CameraPreviewTest, ShowsTheRateOfImages) {
  watch();
  CameraViews::Picture last;
  for (int i = 0; i < 20; ++i) {
    if (const auto picture = look(1000 + 50 * i)) last = picture;
  }
  ASSERT_TRUE(last);
  EXPECT_NEAR(header(*last)["rate_hz"], 20, 0.1);
}

TEST_F(CameraPreviewTest, ContinuesWithAnEarlierClock) {
  watch();
  EXPECT_TRUE(look(50'000));
  pipeline_.emplace(setup_);  // the body restarts with another clock
  EXPECT_TRUE(look(1000));
}

TEST_F(CameraPreviewTest, UsesTheNewestImageAndReleasesOthers) {
  const long held = image_.use_count();
  watch();
  for (int i = 0; i < 10; ++i) expose(1000 + 100 * i);
  EXPECT_LE(image_.use_count(), held + 1) << "one image waits";
  preview_.make_pictures();
  EXPECT_EQ(preview_.pictures(), 1u);
  const auto picture = preview_.take(0);
  ASSERT_TRUE(picture);
  for (int i = 10; i < 20; ++i) look(1000 + 100 * i);
  EXPECT_LE(image_.use_count(), held + 2);
}

TEST_F(CameraPreviewTest, StopsWhenNotWatched) {
  watch();
  EXPECT_TRUE(look(1000));
  expose(1100);
  preview_.watch(0, std::nullopt);
  preview_.make_pictures();
  EXPECT_EQ(preview_.pictures(), 1u) << "the waiting image is dropped";
  EXPECT_EQ(look(1200), nullptr);
  watch();
  EXPECT_EQ(preview_.take(0), nullptr) << "no old picture";
}

TEST_F(CameraPreviewTest, AllocatesNothingInTheWorkerAfterWarmUp) {
  watch();
  for (int i = 0; i < 5; ++i) look(1000 + 100 * i);
  pipeline_.emplace(setup_);
  ASSERT_TRUE(pipeline_->push(CameraFrame{0, at_ms(2000), image_}));
  pipeline_->finish();
  const SensorSample* due = pipeline_->next();
  ASSERT_NE(due, nullptr);
  const SensorSample kept = *due;
  const MapView view{std::make_shared<const TagMap>()};
  const BodyUpdate* update = pipeline_->take(view);
  ASSERT_NE(update, nullptr);
  const AllocationCounter allocations;
  views_->note(kept);
  views_->show(*pipeline_, *update, *view.map);
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_F(CameraPreviewTest, MakesPicturesOnItsThreadUntilStopped) {
  watch();
  std::jthread making([&](std::stop_token stop) { preview_.run(std::move(stop)); });
  expose(1000);
  CameraViews::Picture picture;
  while (!(picture = preview_.take(0))) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_GT(picture->size(), 1000u);
  making.request_stop();
  making.join();
}

}  // namespace
}  // namespace fiducap
