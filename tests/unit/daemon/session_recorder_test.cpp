#include "daemon/recording/session_recorder.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <thread>

#include "daemon/recording/session_files.hpp"
#include "support/fake_clock.hpp"
#include "support/frozen_file.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::SizeIs;
using State = RecordingStatus::State;

Instant at_ms(int ms) { return instant_from_ns(1'000'000'000) + std::chrono::milliseconds(ms); }

class SessionRecorderTest : public testing::Test {
 protected:
  SessionRecorderTest() { recorder_.add_body("drone", one_camera()); }

  static RecordingInfo one_camera() {
    RecordingInfo info;
    info.cameras.resize(1);
    info.cameras[0].model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    info.imu = ImuNoise{};
    return info;
  }
  static CornerFrame corners_at(int ms) {
    return {0, at_ms(ms), {{5, 0, 0, {{{10, 10}, {20, 10}, {20, 20}, {10, 20}}}}}};
  }
  void take_imu(int ms) { recorder_.take(0, ImuSample{at_ms(ms), {0.1, 0.2, 0.3}, {0, 0, 9.81}}); }
  void take(int ms) {
    take_imu(ms);
    recorder_.take(0, corners_at(ms));
  }
  void start_writer() {
    writer_ = std::jthread([this](std::stop_token stop) { recorder_.run(stop); });
  }
  void end_writer() {
    if (!writer_.joinable()) start_writer();
    writer_.request_stop();
    writer_.join();
  }
  template <typename Condition>
  static bool wait_until(Condition condition) {
    for (int i = 0; i < 3000; ++i, std::this_thread::sleep_for(10ms))
      if (condition()) return true;
    return false;
  }
  [[nodiscard]] RecordingStatus newest() const { return recorder_.recordings().back(); }
  bool wait_for(State state) {
    return wait_until([&] { return newest().state == state; });
  }
  /// Starts the writer and a session, and waits until it is recorded.
  void record(const std::string& name) {
    start_writer();
    ASSERT_TRUE(recorder_.start(name));
    ASSERT_TRUE(wait_for(State::kRecording));
  }
  [[nodiscard]] std::string path(const std::string& in_session) const {
    return folder_.file("recordings/" + in_session);
  }
  [[nodiscard]] std::vector<Event> standing() const { return events_.standing(); }
  /// Complete lines, without the header.
  [[nodiscard]] int lines(const std::string& in_session) const {
    const std::string text = content_of(path(in_session));
    return static_cast<int>(std::count(text.begin(), text.end(), '\n')) - 1;
  }

  TemporaryFolder folder_;
  FakeClock clock_{at_ms(0)};
  EventBoard events_{[] { return std::int64_t{0}; }};
  SessionRecorder recorder_{RecorderConfig{folder_.file("recordings"), false}, clock_, events_};
  std::jthread writer_;
};

TEST_F(SessionRecorderTest, WritesWhatCanBeReplayed) {
  take(0);  // before the start: not recorded
  ASSERT_TRUE(recorder_.start("first"));
  for (int ms = 10; ms <= 50; ms += 10) take(ms);
  ASSERT_TRUE(recorder_.stop());
  take(60);
  end_writer();

  const auto info = value_of(read_recording_info(path("first/drone")));
  auto source = value_of(open_recording(info, {}, clock_));
  int imu = 0;
  int corners = 0;
  while (const auto sample = value_of(source->next({}))) {
    if (const auto* reading = std::get_if<ImuSample>(&*sample)) {
      ++imu;
      EXPECT_NEAR(reading->f_B.z(), 9.81, 1e-9);
    } else {
      ++corners;
      EXPECT_EQ(std::get<CornerFrame>(*sample).tags.at(0).tag_id, 5);
    }
  }
  EXPECT_EQ(imu, 5);
  EXPECT_EQ(corners, 5);
  EXPECT_EQ(newest().state, State::kFinished);
  EXPECT_EQ(newest().samples, 10u);
  EXPECT_EQ(newest().dropped, 0u);
  std::uint64_t on_disk = 0;
  for (const auto& file : std::filesystem::recursive_directory_iterator(path("first")))
    if (file.is_regular_file()) on_disk += file.file_size();
  EXPECT_EQ(newest().bytes, on_disk);
}

TEST_F(SessionRecorderTest, TakesPlainNamesOnlyAndOneSessionAtATime) {
  for (const char* bad : {"", "../up", "a/b", ".hidden", "a\nb"})
    EXPECT_FALSE(recorder_.start(bad)) << bad;
  ASSERT_TRUE(recorder_.start("one"));
  EXPECT_FALSE(recorder_.start("two"));
  ASSERT_TRUE(recorder_.stop());
  EXPECT_FALSE(recorder_.stop());
  EXPECT_FALSE(recorder_.start("one")) << "it still waits for the disk";
  EXPECT_TRUE(recorder_.start("two"));
}

TEST_F(SessionRecorderTest, OverwritesNothing) {
  folder_.write("recordings/one/drone/precious", "1");
  ASSERT_TRUE(recorder_.start("one")) << "only the disk knows";
  start_writer();
  ASSERT_TRUE(wait_for(State::kFailed));
  EXPECT_THAT(newest().reason, HasSubstr("nothing is overwritten"));
  EXPECT_FALSE(std::filesystem::exists(path("one/turns.csv")));
  EXPECT_FALSE(recorder_.current());
}

TEST_F(SessionRecorderTest, DoesNotWaitForAFrozenDisk) {
  record("frozen");
  FrozenFile frozen(path("frozen/drone/mav0/tags0/frames.csv"));
  take(10);  // the writer waits for this file from here on
  ASSERT_TRUE(recorder_.stop());
  EXPECT_EQ(newest().state, State::kStopping);
  ASSERT_TRUE(recorder_.start("next"));
  take(20);
  EXPECT_EQ(*recorder_.current(), "next");
  EXPECT_EQ(newest().state, State::kStarting);
  ASSERT_TRUE(recorder_.stop());

  frozen.thaw();
  ASSERT_TRUE(wait_for(State::kFinished));
  EXPECT_EQ(newest().samples, 2u);
  EXPECT_EQ(recorder_.recordings().front().state, State::kFinished);
}

TEST_F(SessionRecorderTest, ReportsAFrozenDiskUntilItWorks) {
  record("frozen");
  FrozenFile frozen(path("frozen/drone/mav0/tags0/frames.csv"));
  ASSERT_TRUE(wait_until([&] {  // until the writer is inside
    take(10);
    clock_.advance(4s);
    return !standing().empty();
  }));
  EXPECT_EQ(standing().front().subject, "recorder");
  EXPECT_EQ(standing().front().kind, "slow");
  frozen.thaw();
  EXPECT_TRUE(wait_until([&] { return standing().empty(); }));
}

TEST_F(SessionRecorderTest, EndsTheSessionWhenTheDiskIsFull) {
  record("full");
  std::filesystem::create_directories(path("full/drone/mav0/tags0"));
  std::filesystem::create_symlink("/dev/full", path("full/drone/mav0/tags0/data.csv"));
  take_imu(5);
  take(10);
  ASSERT_TRUE(wait_for(State::kFailed));
  EXPECT_THAT(newest().reason, HasSubstr("No space left on device"));
  EXPECT_THAT(newest().reason, HasSubstr("tags0/data.csv"));
  EXPECT_GT(newest().bytes, 0u);
  EXPECT_EQ(lines("full/drone/mav0/imu0/data.csv"), 2) << "other files keep their lines";
  EXPECT_FALSE(recorder_.current());
  EXPECT_THAT(error_of(recorder_.stop()), HasSubstr("No space left on device"));
  ASSERT_THAT(standing(), SizeIs(1));
  EXPECT_EQ(standing().front().kind, "failing");
  EXPECT_THAT(standing().front().text, HasSubstr("No space left on device"));
  EXPECT_FALSE(standing().front().remedy.empty());

  ASSERT_TRUE(recorder_.start("room again"));
  EXPECT_TRUE(wait_for(State::kRecording));
  EXPECT_TRUE(wait_until([&] { return standing().empty(); }));
  take(20);
  ASSERT_TRUE(recorder_.stop());
  EXPECT_TRUE(wait_for(State::kFinished));
}

TEST_F(SessionRecorderTest, DropsAnInvalidSample) {
  ASSERT_TRUE(recorder_.start("odd"));
  CornerFrame odd = corners_at(5);
  odd.camera = 7;
  recorder_.take(0, odd);
  take(10);
  end_writer();
  EXPECT_THAT(newest(), testing::FieldsAre("odd", State::kFinished, "", 2u, testing::_, 1u));
}

TEST_F(SessionRecorderTest, RecoversFromAFolderThatCannotBeMade) {
  folder_.write("recordings", "a file");
  start_writer();
  ASSERT_TRUE(recorder_.start("first"));
  take(10);
  ASSERT_TRUE(wait_for(State::kFailed));
  std::filesystem::remove(folder_.file("recordings"));
  ASSERT_TRUE(recorder_.start("first"));
  EXPECT_TRUE(wait_for(State::kRecording));
}

TEST_F(SessionRecorderTest, FlushesEveryStreamWithinASecond) {
  recorder_.set_surroundings({"", [] {
                                return MapView{std::make_shared<const TagMap>(), true, 0};
                              }});
  BodyUpdate update;
  record("killed");
  take(10);
  update.corners = corners_at(10);
  recorder_.take_turn(0, update, {}, 0);
  const auto all_have = [&](int count) {
    return lines("killed/drone/mav0/imu0/data.csv") == count &&
           lines("killed/drone/mav0/tags0/frames.csv") == count &&
           lines("killed/drone/mav0/tags0/data.csv") == count && lines("killed/turns.csv") == count;
  };
  EXPECT_FALSE(all_have(1)) << "lines are buffered";
  // No file is closed, and no sample follows.
  EXPECT_TRUE(wait_until([&] {
    clock_.advance(100ms);
    return all_have(1);
  }));
  EXPECT_EQ(newest().state, State::kRecording);
  EXPECT_TRUE(wait_until([&] { return newest().samples == 2; })) << "counted";
}

TEST_F(SessionRecorderTest, UsesTheNextFreeNameAtStart) {
  folder_.write("recordings/flight/drone/precious", "1");
  std::filesystem::create_directories(path("flight-2"));
  ASSERT_TRUE(recorder_.start_and_open("flight"));
  EXPECT_EQ(recorder_.current(), "flight-3");
  EXPECT_EQ(newest().state, State::kRecording);
  EXPECT_FALSE(recorder_.start_and_open("../flight"));
}

TEST_F(SessionRecorderTest, AbandonsAStuckDiskAndReportsIt) {
  record("stuck");
  FrozenFile frozen(path("stuck/drone/mav0/tags0/frames.csv"));
  take(10);
  writer_.request_stop();
  EXPECT_TRUE(wait_until([&] {  // again if the writer had not reached the frozen file
    const Instant before = clock_.now();
    return !recorder_.ends() && clock_.now() - before < 3s;
  }));
  ASSERT_FALSE(events_.after(0).empty());
  EXPECT_EQ(events_.after(0).back().kind, "lost");
  frozen.thaw();
  writer_.join();
  EXPECT_TRUE(recorder_.ends());
}

TEST_F(SessionRecorderTest, DropsImagesOnASlowDisk) {
  const TemporaryFolder elsewhere;
  SessionRecorder recorder{RecorderConfig{elsewhere.file("recordings"), true}, clock_, events_};
  recorder.add_body("drone", one_camera());
  const auto image = std::make_shared<GrayImage>();
  image->resize(2000, 1000);
  constexpr int kImages = 200;  // 400 MB
  constexpr int kFit = static_cast<int>(RecordingQueue::kImages_bytes / 2'000'000);
  ASSERT_TRUE(recorder.start("slow"));  // without a writer
  for (int ms = 1; ms <= kImages; ++ms) {
    recorder.take(0, CameraFrame{0, at_ms(ms), image});
    recorder.take(0, ImuSample{at_ms(ms), {0.1, 0.2, 0.3}, {0, 0, 9.81}});
  }
  const auto status = recorder.recordings().back();
  EXPECT_NEAR(static_cast<double>(status.dropped), kImages - kFit, 1);
  ASSERT_THAT(standing(), SizeIs(1));
  EXPECT_EQ(standing().front().kind, "slow");
  EXPECT_EQ(standing().front().severity, Severity::kError);
  EXPECT_THAT(events_.after(0), SizeIs(1)) << "once, not for each image";

  elsewhere.write("recordings", "no folder: queued samples are dropped");
  std::jthread writer([&](std::stop_token stop) { recorder.run(stop); });
  writer.request_stop();
  writer.join();
  ASSERT_THAT(standing(), SizeIs(1));
  EXPECT_EQ(standing().front().kind, "failing") << "slow is over";
  EXPECT_EQ(recorder.recordings().back().dropped, 2u * kImages);
}

class RecordingQueueTest : public testing::Test {
 protected:
  bool put(RecordedThing what) { return queue_.put({session_, 0, std::move(what)}); }
  /// @return number of accepted samples
  template <typename Sample>
  std::size_t fill(const Sample& sample) {
    std::size_t count = 0;
    while (put(SensorSample(sample))) ++count;
    return count;
  }

  std::shared_ptr<RecordedSession> session_ = std::make_shared<RecordedSession>("flight");
  RecordingQueue queue_;
};

TEST_F(RecordingQueueTest, LimitsEveryKindByItsSize) {
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
  EXPECT_TRUE(put(SessionEnd{})) << "always taken";
  EXPECT_TRUE(put(SessionStart{}));
}

TEST_F(RecordingQueueTest, CountsImagesByTheirPixels) {
  const auto image = std::make_shared<GrayImage>();
  image->resize(4000, 3000);
  EXPECT_EQ(fill(CameraFrame{0, {}, image}), RecordingQueue::kImages_bytes / 12'000'000);
}

TEST_F(RecordingQueueTest, CountsItemsUntilTheyAreWritten) {
  const auto image = std::make_shared<GrayImage>();
  image->resize(4000, 3000);
  const SensorSample sample = CameraFrame{0, {}, image};
  fill(sample);
  std::deque<RecordedItem> batch;
  queue_.take_all(batch);
  EXPECT_TRUE(queue_.empty());
  EXPECT_FALSE(put(sample));
  for (const RecordedItem& item : batch) queue_.written(item);
  EXPECT_EQ(queue_.bytes(), 0u);
  EXPECT_TRUE(put(sample));
}

}  // namespace
}  // namespace fiducap
