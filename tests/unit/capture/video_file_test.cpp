#include "capture/video/video_source.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/log.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::video {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

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
    said_before_ = log::lines_after(0).empty() ? 0 : log::lines_after(0).back().number;
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
  std::string said() const {
    std::string all;
    for (const log::Line& line : log::lines_after(said_before_)) all += line.text + "\n";
    return all;
  }

  FakeClock clock_{instant_from_ns(7'000'000'000)};
  std::uint64_t said_before_{0};
};

TEST_F(VideoFileTest, OnAQuickComputerNothingIsLeftOut) {
  const Played played = play(20, 5);
  EXPECT_EQ(played.frames.size(), 300u);
  EXPECT_EQ(played.left_out, 0u);
  EXPECT_EQ(said(), "");
}

TEST_F(VideoFileTest, WhatIsTooSlowToDecodeKeepsItsPaceByLeavingOutImages) {
  const Instant began = clock_.now();
  const Played played = play(15, 26);  // 41 ms
  const Duration lasted = clock_.now() - began;
  EXPECT_LT(lasted, 300 * kPeriod + std::chrono::milliseconds(200));
  EXPECT_EQ(played.frames.size() + played.left_out, 300u);
  EXPECT_LT(played.latest, 2 * kPeriod + std::chrono::milliseconds(41));
  std::uint64_t told = 0;
  for (std::size_t i = 1; i < played.frames.size(); ++i) {
    const Duration step = played.frames[i].exposed_at - played.frames[i - 1].exposed_at;
    EXPECT_EQ(step, kPeriod * (1 + played.frames[i].lost_before)) << "the pace of the file";
    told += played.frames[i].lost_before;
  }
  EXPECT_EQ(told, played.left_out);
}

TEST_F(VideoFileTest, ThatImagesAreLeftOutIsSaidOnceInWords) {
  (void)play(15, 26);
  EXPECT_THAT(said(),
              AllOf(HasSubstr("field.mp4 needs 41 ms to decode an image here, its images come "
                              "every 33 ms: 10 of the first "),
                    HasSubstr("use a smaller video"), Not(HasSubstr("slower"))));
  EXPECT_EQ(said().find("left out"), said().rfind("left out"));
}

TEST_F(VideoFileTest, WhatIsTooSlowEvenThenPlaysSlower) {
  const Played played = play(50, 5);
  ASSERT_GT(played.frames.size(), 300u / 10);
  EXPECT_LT(played.latest, std::chrono::milliseconds(500)) << "it does not fall behind for ever";
  for (std::size_t i = 1; i < played.frames.size(); ++i)
    EXPECT_GT(played.frames[i].exposed_at, played.frames[i - 1].exposed_at);
  EXPECT_THAT(said(), HasSubstr("plays slower than it was taken"));
}

TEST_F(VideoFileTest, AComputerThatPausesOnceIsNotCalledSlow) {
  clock_.advance(std::chrono::seconds(1));
  const Played played = play(1, 1, 20);
  EXPECT_EQ(played.left_out, 0u);
  EXPECT_EQ(said(), "");
}

}  // namespace
}  // namespace fiducap::video
