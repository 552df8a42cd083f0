#include "daemon/recording/session_files.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

class RecordingQueueTest : public testing::Test {
 protected:
  bool put(RecordedThing what) { return queue_.put({session_, 0, std::move(what)}); }
  /// @return how many were taken before the first that was not
  template <typename Sample>
  std::size_t fill(const Sample& sample) {
    std::size_t count = 0;
    while (put(SensorSample(sample))) ++count;
    return count;
  }

  std::shared_ptr<RecordedSession> session_ = std::make_shared<RecordedSession>("flight");
  RecordingQueue queue_;
};

TEST_F(RecordingQueueTest, HoldsEveryKindByItsSize) {
  CornerFrame corners;
  corners.tags.resize(50);
  corners.points.resize(60);
  const std::size_t frames = fill(corners);
  EXPECT_LT(frames * (50 * sizeof(TagSighting) + 60 * sizeof(PointSighting)),
            RecordingQueue::kImages_bytes);
  EXPECT_LE(queue_.bytes(), RecordingQueue::kImages_bytes);
  const std::size_t readings = fill(ImuSample{});
  EXPECT_LE(queue_.bytes(), RecordingQueue::kMost_bytes);
  EXPECT_GT(readings, 200u * 60) << "a minute of IMU after the last image";
  EXPECT_FALSE(put(MapTurn{}));
}

TEST_F(RecordingQueueTest, ImagesCountWithTheirPixels) {
  const auto image = std::make_shared<GrayImage>();
  image->resize(4000, 3000);
  EXPECT_EQ(fill(CameraFrame{0, {}, image}), RecordingQueue::kImages_bytes / 12'000'000);
}

TEST_F(RecordingQueueTest, TheEndOfASessionAlwaysFits) {
  fill(ImuSample{});
  EXPECT_TRUE(put(SessionEnd{}));
  EXPECT_TRUE(put(SessionBegin{}));
}

TEST_F(RecordingQueueTest, WhatIsTakenCountsUntilItIsWritten) {
  fill(ImuSample{});
  std::deque<RecordedItem> batch;
  queue_.take_all(batch);
  EXPECT_TRUE(queue_.empty());
  EXPECT_FALSE(put(SensorSample(ImuSample{})));
  for (const RecordedItem& item : batch) queue_.written(item);
  EXPECT_EQ(queue_.bytes(), 0u);
  EXPECT_TRUE(put(SensorSample(ImuSample{})));
}

}  // namespace
}  // namespace fiducap
