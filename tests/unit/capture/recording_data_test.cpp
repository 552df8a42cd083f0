// Every recording of the shared data. The numbers are those of data/README.md and of the files.
#include <gtest/gtest.h>

#include <set>

#include "capture/recording/recording.hpp"
#include "support/fake_clock.hpp"
#include "support/shared_data.hpp"
#include "unit/capture/sample_stamps.hpp"

namespace fiducap {
namespace {

struct Known {
  const char* name;
  std::size_t cameras;
  bool has_imu;
  std::size_t detections;
  std::size_t true_tags;
};
std::ostream& operator<<(std::ostream& out, const Known& known) { return out << known.name; }

class RecordingDataTest : public testing::TestWithParam<Known> {
 protected:
  void SetUp() override {
    const auto data = shared_data();
    if (!data) GTEST_SKIP() << kNoSharedData;
    folder_ = (*data / GetParam().name).string();
  }
  std::string folder_;
  FakeClock clock_;
};

INSTANTIATE_TEST_SUITE_P(
    Shared, RecordingDataTest,
    testing::Values(Known{"sim_table", 1, true, 3239, 3}, Known{"sim_sparse", 1, true, 1053, 3},
                    Known{"sim_loop", 1, true, 4539, 36}, Known{"sim_big", 1, true, 18793, 100},
                    Known{"tagslam_1", 1, false, 772, 4}, Known{"tagslam_6", 4, false, 61619, 35},
                    Known{"tagslam_7", 4, false, 3235, 9}, Known{"tagslam_8", 4, false, 2217, 31},
                    Known{"tagslam_9", 2, false, 4170, 57}, Known{"tagslam_10", 1, false, 3094, 83},
                    Known{"tagslam_14", 4, false, 14655, 32},
                    Known{"tagslam_16", 1, false, 1471, 5}, Known{"tagslam_20", 4, false, 64501, 0},
                    Known{"tagslam_22", 1, false, 105, 2},
                    Known{"invisiblemap_qea_room", 1, false, 200, 8},
                    Known{"invisiblemap_floor2_straight", 1, false, 54, 0},
                    Known{"invisiblemap_occam209_straight", 1, false, 150, 0}),
    [](const auto& tested) { return std::string(tested.param.name); });

TEST_P(RecordingDataTest, IsReadToTheLastDetection) {
  const RecordingInfo info = value_of(read_recording_info(folder_));
  EXPECT_EQ(info.cameras.size(), GetParam().cameras);
  EXPECT_EQ(info.imu.has_value(), GetParam().has_imu);
  const auto source = value_of(open_recording(info, {}, clock_));
  std::size_t imu = 0;
  std::size_t frames = 0;
  std::size_t detections = 0;
  Instant last{};
  std::vector<Instant> last_of_camera(info.cameras.size());
  while (const auto sample = value_of(source->next({}))) {
    EXPECT_GE(time_of(*sample), last) << "merged by time";
    last = time_of(*sample);
    if (const auto* frame = std::get_if<CornerFrame>(&*sample)) {
      EXPECT_GT(last, std::exchange(last_of_camera[static_cast<std::size_t>(frame->camera)], last));
      ++frames;
      detections += frame->tags.size();
      for (const TagSighting& tag : frame->tags) EXPECT_TRUE(tag.corners_px[0].allFinite());
    } else {
      ++imu;
    }
  }
  EXPECT_EQ(detections, GetParam().detections);
  EXPECT_GT(frames, 0u);
  EXPECT_EQ(imu > 0, GetParam().has_imu);
}

TEST_P(RecordingDataTest, HasReadableTruth) {
  EXPECT_EQ(value_of(read_truth_tags(folder_)).size(), GetParam().true_tags);
  const auto X_BV = value_of(read_truth_extrinsics(folder_));
  EXPECT_TRUE(X_BV.empty() || X_BV.size() == GetParam().cameras);
  const auto truth = value_of(read_truth(folder_));
  EXPECT_EQ(!truth.empty(), GetParam().has_imu) << "only the simulator has truth";
  for (const auto& poses : {truth, value_of(read_reference_poses(folder_))})
    for (std::size_t i = 1; i < poses.size(); ++i) EXPECT_GT(poses[i].at, poses[i - 1].at);
}

}  // namespace
}  // namespace fiducap
