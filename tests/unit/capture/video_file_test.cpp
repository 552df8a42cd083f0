#include "capture/video/video_source.hpp"

#include <gmock/gmock.h>

#include <opencv2/videoio.hpp>

#include "support/fake_clock.hpp"
#include "support/new_log.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap::video {
namespace {

using testing::HasSubstr;

constexpr Duration kPeriod = std::chrono::milliseconds(33);

/// A decoder on a computer of some speed.
class SlowDecoder final : public VideoStream {
 public:
  SlowDecoder(FakeClock& clock, Duration grab, Duration convert, int images)
      : clock_(clock), grab_(grab), convert_(convert), images_(images) {}
  bool grab() override {
    if (next_ >= images_) return false;
    clock_.advance(grab_);
    ++next_;
    return true;
  }
  Duration place() const override { return (next_ - 1) * kPeriod; }
  Expected<std::shared_ptr<const GrayImage>> image() override {
    clock_.advance(convert_);
    return std::make_shared<const GrayImage>();
  }
  bool rewind() override { return false; }

 private:
  FakeClock& clock_;
  Duration grab_, convert_;
  int images_;
  int next_{0};
};

class VideoFileTest : public testing::Test {
 protected:
  struct Played {
    std::vector<CameraFrame> frames;
    Duration latest{0};  ///< Of all images, when it came after it was due.
    std::uint64_t left_out{};
  };
  Played play(int grab_ms, int convert_ms, int images = 300) {
    log_ = {};
    CameraDeviceConfig config;
    config.open = "/videos/field.mp4";
    VideoFile file(std::make_unique<SlowDecoder>(clock_, std::chrono::milliseconds(grab_ms),
                                                 std::chrono::milliseconds(convert_ms), images),
                   1 / to_seconds(kPeriod), config, clock_);
    Played played;
    for (auto sample = file.next({}); sample && *sample; sample = file.next({})) {
      played.latest = std::max(played.latest, clock_.now() - time_of(**sample));
      played.frames.push_back(std::get<CameraFrame>(**sample));
    }
    played.left_out = file.left_out();
    return played;
  }

  FakeClock clock_{instant_from_ns(7'000'000'000)};
  NewLog log_;
};

TEST_F(VideoFileTest, DropsNothingOnAFastComputer) {
  Played played = play(20, 5);
  EXPECT_EQ(played.frames.size(), 300u);
  EXPECT_EQ(played.left_out, 0u);
  EXPECT_EQ(log_.text(), "");
  clock_.advance(std::chrono::seconds(1));  // one pause
  played = play(1, 1, 20);
  EXPECT_EQ(played.left_out, 0u);
  EXPECT_EQ(log_.text(), "");
}

TEST_F(VideoFileTest, DropsImagesToKeepThePaceAndReportsItOnce) {
  const Instant began = clock_.now();
  const Played played = play(15, 26);  // 41 ms
  EXPECT_LT(clock_.now() - began, 300 * kPeriod + std::chrono::milliseconds(200));
  EXPECT_EQ(played.frames.size() + played.left_out, 300u);
  EXPECT_LT(played.latest, 2 * kPeriod + std::chrono::milliseconds(41));
  std::uint64_t lost = 0;
  for (std::size_t i = 1; i < played.frames.size(); ++i) {
    const Duration step = played.frames[i].exposed_at - played.frames[i - 1].exposed_at;
    EXPECT_EQ(step, kPeriod * (1 + played.frames[i].lost_before)) << "the pace of the file";
    lost += played.frames[i].lost_before;
  }
  EXPECT_EQ(lost, played.left_out);
  const std::string text = log_.text();
  EXPECT_THAT(text,
              testing::AllOf(HasSubstr("field.mp4 needs 41 ms to decode an image here, its images "
                                       "come every 33 ms: 10 of the first "),
                             HasSubstr("use a smaller video"), testing::Not(HasSubstr("slower"))));
  EXPECT_EQ(text.find("left out"), text.rfind("left out"));
}

TEST_F(VideoFileTest, PlaysSlowlyWhatItCannotDecodeInTime) {
  const Played played = play(50, 5);
  ASSERT_GT(played.frames.size(), 300u / 10);
  EXPECT_LT(played.latest, std::chrono::milliseconds(500)) << "bounded";
  for (std::size_t i = 1; i < played.frames.size(); ++i)
    EXPECT_GT(played.frames[i].exposed_at, played.frames[i - 1].exposed_at);
  EXPECT_THAT(log_.text(), HasSubstr("plays slower than it was taken"));
}

/// H.264 holds images back to put them in order; OpenCV has no times of the last ones.
TEST_F(VideoFileTest, LastImagesHaveTheTimesOfTheContainer) {
  constexpr int kImages = 20;
  constexpr Duration kStep = std::chrono::milliseconds(40);
  const TemporaryFolder folder;
  const std::string path = folder.file("walk.mp4");
  {
    cv::VideoWriter writer(path, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'), 25,
                           {320, 240});
    ASSERT_TRUE(writer.isOpened());
    for (int i = 0; i < kImages; ++i) {
      cv::Mat image(240, 320, CV_8UC3, cv::Scalar::all(40));
      image.colRange(10 * i, 10 * i + 60) = cv::Scalar::all(220);
      writer.write(image);
    }
  }
  const auto stamps = container_stamps(path);
  ASSERT_EQ(stamps.size(), std::size_t{kImages});
  for (int i = 0; i < kImages; ++i) EXPECT_EQ(stamps[static_cast<std::size_t>(i)], i * kStep);
  auto opened = open_video(VideoKind::kFile, path, path, {});
  ASSERT_TRUE(opened) << opened.error().text();
  CameraDeviceConfig config;
  config.paced = false;
  constexpr double kWrong_hz = 10;  // counting would give steps of 100 ms
  VideoFile file(std::move(opened->stream), kWrong_hz, config, clock_);
  int images = 0;
  for (auto sample = file.next({}); sample && *sample; sample = file.next({}))
    EXPECT_EQ(time_of(**sample), Instant{} + kStep * images++);
  EXPECT_EQ(images, kImages);
  EXPECT_TRUE(container_stamps(folder.file("nothing.mp4")).empty());
}

}  // namespace
}  // namespace fiducap::video
