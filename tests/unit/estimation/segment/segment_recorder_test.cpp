// Segments of a body have each sample once; a new chain begins when the filter has lost the motion.
#include "estimation/segment/segment_recorder.hpp"

#include <gmock/gmock.h>

#include <functional>
#include <map>
#include <utility>

#include "base/pose.hpp"
#include "known_motion.hpp"
#include "support/idle_filter.hpp"

namespace fiducap {
namespace {

constexpr double kImage_s = 0.05;
constexpr double kOffReadings_s = 0.0023;  // images do not fall on readings

/// A filter with given results.
class RecordedFilter final : public IdleFilter<> {
 public:
  [[nodiscard]] bool running() const override { return is_running; }
  [[nodiscard]] BodyEstimate estimate() const override { return body; }
  void own_tags(std::vector<TagBelief>& out) const override { out = tags; }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override { return cameras; }
  [[nodiscard]] LearnedSensors learned(int) const override { return learned_sensors; }

  bool is_running{true};
  BodyEstimate body;
  std::vector<ExtrinsicsEstimate> cameras{2};
  LearnedSensors learned_sensors;
  std::vector<TagBelief> tags;  ///< In the state, also of a start that may be replaced.
};

using Change = std::function<void(UpdateReport&)>;
void open_start(UpdateReport& report) { report.start_is_open = true; }

/// A body with the motion of known_motion.hpp before tags, some of which have a known pose.
class SegmentRecorderTest : public testing::Test {
 protected:
  static BodySensors sensors_of(bool has_imu) {
    BodySensors sensors;
    sensors.cameras.resize(2);
    if (has_imu) sensors.imu = ImuNoise{};
    return sensors;
  }

  /// Readings up to the first one after the next image, then that image, as SampleMerger gives them
  /// out. `change` may change what is reported of it.
  void image(const std::vector<int>& tags, const Change& change = nullptr) {
    t_s_ += kImage_s;
    while (has_imu_ && imu_s_ < t_s_ + kOffReadings_s) {
      imu_s_ += to_seconds(kImuPeriod);
      // The rate encodes the time of its reading: sums over steps can be checked.
      recorder_.add(ImuSample{at_s(imu_s_), {imu_s_, 0, 1}, {0, 0, kGravity}});
    }
    show(tags, 0, change);
  }
  void images(int count, const std::vector<int>& tags, const Change& change = nullptr) {
    for (int i = 0; i < count; ++i) image(tags, change);
  }

  /// Another image at the same moment.
  void show(const std::vector<int>& tags, int camera, const Change& change = nullptr) {
    TagObservations seen;
    seen.camera = camera;
    seen.exposed_at = at_s(t_s_ + kOffReadings_s);
    for (const int tag_id : tags) {
      TagObservation tag;
      tag.tag_id = tag_id;
      tag.corners_px[0].x() = shown_++;  // all different
      seen.tags.push_back(tag);
    }
    filter_.body = Motion::truth(t_s_ + kOffReadings_s);
    filter_.body.X_WB = X_WM_ * filter_.body.X_WB;
    filter_.body.v_WB = X_WM_.q * filter_.body.v_WB;
    filter_.body.anchored = is_anchored_;
    UpdateReport report;
    if (change) change(report);
    recorder_.add(seen, filter_, report, beliefs_, known_);
    if (const auto segment = recorder_.take()) segments_.push_back(*segment);
  }

  void place(int tag_id) {
    beliefs_.push_back({{tag_id, 0.2, X_WM_ * place_of(tag_id), {}}, 1, {}, {}, 0});
  }
  static Pose place_of(int tag_id) { return {exp_so3({0.3, 0, 0}), {2.0 + tag_id, 1, 1}}; }

  /// How often each corner that was shown, or each tag, is in a segment.
  template <class Key>
  [[nodiscard]] std::map<int, int> count_sightings(const Key& key) const {
    std::map<int, int> count;
    for (const MotionSegment& segment : segments_)
      for (const auto& instance : segment.instances)
        for (const SegmentImage& image : instance.images)
          for (const SegmentSighting& s : image.tags) ++count[key(s.seen)];
    return count;
  }
  [[nodiscard]] std::map<int, int> corners() const {
    return count_sightings(
        [](const TagObservation& seen) { return static_cast<int>(seen.corners_px[0].x()); });
  }
  void expect_corners_since(int first) const {
    for (const auto& [corner, times] : corners()) EXPECT_GE(corner, first);
  }

  static double seconds_of(const MotionSegment& segment) {
    return to_seconds(segment.end().at - segment.begin().at);
  }
  static std::vector<int> tags_of(const MotionSegment& segment) {
    std::vector<int> out;
    for (const KnownTag& tag : segment.tags) out.push_back(tag.tag_id);
    return out;
  }

  RecordedFilter filter_;
  SegmentRecorder recorder_{sensors_of(true), EstimatorConfig{}};
  std::vector<TagBelief> beliefs_;
  std::vector<KnownTag> known_;
  std::vector<MotionSegment> segments_;
  Pose X_WM_;  ///< Where the filter has the axes of the motion.
  bool is_anchored_{true};
  bool has_imu_{true};
  double t_s_{0};
  double imu_s_{0};
  int shown_{0};
};

TEST_F(SegmentRecorderTest, CutsAfterASecondWithoutGapsAndHasEveryReadingOnceInOrder) {
  place(1);
  images(70, {1});
  ASSERT_EQ(segments_.size(), 3u);
  for (const MotionSegment& segment : segments_) {
    EXPECT_NEAR(seconds_of(segment), 1.0, 1e-6);
    EXPECT_EQ(segment.chain, segments_[0].chain);
    EXPECT_TRUE(segment.anchored);
    EXPECT_TRUE(segment.has_imu());
    EXPECT_EQ(segment.instances.size(), 21u);
    EXPECT_EQ(segment.cameras.size(), 2u);
    EXPECT_THAT(tags_of(segment), testing::ElementsAre(1));
  }
  for (std::size_t i = 1; i < segments_.size(); ++i) {
    const BodyMoment& end = segments_[i - 1].end();
    const BodyMoment& begin = segments_[i].begin();
    EXPECT_EQ(end.at, begin.at);
    EXPECT_EQ(end.X_WB.p, begin.X_WB.p);
    EXPECT_EQ(end.v_WB, begin.v_WB);
    EXPECT_TRUE(segments_[i].instances.front().images.empty()) << "they are in the one before";
  }
  EXPECT_EQ(segments_[0].instances.front().images.size(), 1u);

  Instant reached = segments_.front().begin().at;
  for (const MotionSegment& segment : segments_) {
    EXPECT_TRUE(segment.instances.front().steps.empty());
    for (const auto& instance : segment.instances) {
      for (const SegmentStep& step : instance.steps) {
        ASSERT_GT(step.dt_s, 0);
        // The rate of the middle of the step: none is left out, none comes twice.
        EXPECT_NEAR(step.input.w_B.x(), to_seconds(reached - at_s(0)) + 0.5 * step.dt_s, 1e-6);
        reached += from_seconds(step.dt_s);
      }
      EXPECT_EQ(reached, instance.body.at);
    }
  }
}

TEST_F(SegmentRecorderTest, HasEveryCornerOnceAlsoOfTwoCamerasAtOneMoment) {
  place(1);
  place(2);
  for (int i = 0; i < 64; ++i) {
    image({1, 2});
    show({2}, 1);
  }
  ASSERT_EQ(segments_.size(), 3u);
  std::map<int, int> once;
  // The last segment ends with the first camera's image.
  for (int corner = 0; corner < 3 * 61 - 1; ++corner) once[corner] = 1;
  EXPECT_EQ(corners(), once);
}

TEST_F(SegmentRecorderTest, HoldsTheSegmentsOfAStartUntilItIsFinal) {
  place(1);
  filter_.tags = std::exchange(beliefs_, {});  // none may be used
  images(70, {1}, open_start);
  EXPECT_TRUE(segments_.empty());
  beliefs_ = filter_.tags;
  images(5, {1});
  EXPECT_EQ(segments_.size(), 3u) << "one with each image";
  EXPECT_EQ(corners().begin()->first, 0) << "from the first image on";
}

TEST_F(SegmentRecorderTest, DiscardsTheSegmentsOfAReplacedStart) {
  place(1);
  filter_.tags = beliefs_;
  images(70, {1}, open_start);
  const int before = shown_;
  image({1}, [](UpdateReport& r) { r.start_changed = true; });
  images(45, {1});
  ASSERT_FALSE(segments_.empty());
  expect_corners_since(before);
}

TEST_F(SegmentRecorderTest, BeginsAChainAfterTheFilterHasLostTheBody) {
  int generation = 0;
  const std::map<std::string, Change> breaks{
      {"restart", [&](UpdateReport&) { generation = 1; }},
      {"relocalisation", [](UpdateReport& r) { r.relocalised = true; }},
      {"clock", [](UpdateReport& r) { r.clock_jump = UpdateReport::ClockJump{}; }},
      {"elsewhere", [](UpdateReport& r) { r.ambiguous_place = UpdateReport::AmbiguousPlace{}; }},
      {"stop", [this](UpdateReport&) { filter_.is_running = false; }},
      {"break_chain()", [this](UpdateReport&) { recorder_.break_chain(); }}};
  const Change same = [&](UpdateReport& r) { r.generation = generation; };
  place(1);
  for (const auto& [name, change] : breaks) {
    SCOPED_TRACE(name);
    segments_.clear();
    images(30, {1}, same);
    ASSERT_FALSE(segments_.empty());
    const int chain = segments_.back().chain;
    segments_.clear();
    const int before = shown_;
    image({1}, [&, &apply = change](UpdateReport& r) {
      apply(r);
      same(r);
    });
    filter_.is_running = true;
    images(21, {1}, same);
    ASSERT_FALSE(segments_.empty());
    EXPECT_EQ(segments_.back().chain, chain + 1);
    EXPECT_EQ(segments_.back().instances.front().images.size(), 1u);
    expect_corners_since(before);
  }
}

TEST_F(SegmentRecorderTest, ATagWithALatePoseAddsAllItsSightings) {
  place(1);
  images(12, {1, 7, 8});
  place(7);
  images(10, {1, 7, 8});
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_THAT(tags_of(segments_[0]), testing::ElementsAre(1, 7)) << "8 has no pose";
  auto sightings = count_sightings([](const TagObservation& seen) { return seen.tag_id; });
  EXPECT_EQ(sightings[1], 21);
  EXPECT_EQ(sightings[7], 21);
}

TEST_F(SegmentRecorderTest, DropsImagesWithoutTagsButNotTheirReadings) {
  place(1);
  image({1});
  images(5, {});
  images(5, {8});  // its pose is unknown
  images(15, {1});
  ASSERT_EQ(segments_.size(), 1u);
  double felt_s = 0;
  int images = 0;
  for (const auto& instance : segments_[0].instances) {
    images += static_cast<int>(instance.images.size());
    for (const SegmentStep& step : instance.steps) felt_s += step.dt_s;
  }
  EXPECT_EQ(images, 11);
  EXPECT_NEAR(felt_s, seconds_of(segments_[0]), 1e-9);
}

TEST_F(SegmentRecorderTest, BeginsAndEndsAtAnImageWithAPlacedTag) {
  images(10, {8});
  place(1);
  images(10, {1});
  images(20, {});
  images(5, {8});
  EXPECT_TRUE(segments_.empty());
  image({1});
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_EQ(segments_[0].begin().at, at_s(11 * kImage_s + kOffReadings_s));
  EXPECT_NEAR(seconds_of(segments_[0]), 35 * kImage_s, 1e-6);
}

TEST_F(SegmentRecorderTest, BeginsAChainAfterTenSecondsWithoutATag) {
  place(1);
  images(30, {1});
  ASSERT_EQ(segments_.size(), 1u);
  for (int i = 0; i < 220; ++i) image(i % 2 == 0 ? std::vector<int>{} : std::vector<int>{8});
  images(22, {1});
  ASSERT_EQ(segments_.size(), 2u);
  EXPECT_EQ(segments_[1].chain, segments_[0].chain + 1);
  EXPECT_NEAR(seconds_of(segments_[1]), 1.0, 1e-6);
}

TEST_F(SegmentRecorderTest, MovesWithTheWorkspace) {
  constexpr double kRoundOff = 1e-12;
  const Pose G{exp_so3({0, 0, 1.2}), {3, -5, 1}};
  is_anchored_ = false;
  place(1);
  images(5, {1, 2});
  place(2);
  images(5, {1, 2});
  X_WM_ = G;
  is_anchored_ = true;
  beliefs_.clear();
  place(1);  // 2 has left the state
  image({1, 2}, [&](UpdateReport& r) { r.gauge_shift = G; });
  images(10, {1, 2});
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_TRUE(segments_[0].anchored);
  for (const auto& instance : segments_[0].instances) {
    const BodyEstimate truth = Motion::truth(to_seconds(instance.body.at - at_s(0)));
    EXPECT_LT((instance.body.X_WB.p - G * truth.X_WB.p).norm(), kRoundOff);
    EXPECT_LT(angle_between(instance.body.X_WB.q, G.q * truth.X_WB.q), 1e-7);
    EXPECT_LT((instance.body.v_WB - G.q * truth.v_WB).norm(), kRoundOff);
  }
  ASSERT_EQ(segments_[0].tags.size(), 2u);
  for (const KnownTag& tag : segments_[0].tags)
    EXPECT_LT((tag.X_WT.p - (G * place_of(tag.tag_id)).p).norm(), kRoundOff) << tag.tag_id;
}

TEST_F(SegmentRecorderTest, PrefersPosesOfTheFilterAndUsesTheMapsInItsAxes) {
  known_.push_back({1, 0.2, {Eigen::Quaterniond::Identity(), {9, 9, 9}}, {}});
  known_.push_back({3, 0.2, place_of(3), {}});
  is_anchored_ = false;
  images(30, {3});
  EXPECT_TRUE(segments_.empty()) << "its axes are not the map's";
  is_anchored_ = true;
  place(1);
  images(22, {1, 3});
  ASSERT_EQ(segments_.size(), 1u);
  ASSERT_THAT(tags_of(segments_[0]), testing::ElementsAre(1, 3));
  EXPECT_EQ(segments_[0].tags[0].X_WT.p, place_of(1).p);
  EXPECT_EQ(segments_[0].tags[1].X_WT.p, place_of(3).p);
}

TEST_F(SegmentRecorderTest, UsesTheNoiseAndCamerasLearnedByTheFilter) {
  place(1);
  filter_.learned_sensors = {nullptr, 4.0, 0.003};
  filter_.cameras[1].clock.shift_s = 0.02;
  filter_.cameras[1].lens.offset.focal = 0.01;
  images(22, {1});
  ASSERT_EQ(segments_.size(), 1u);
  const InertialInput& input = segments_[0].instances[3].steps.front().input;
  EXPECT_NEAR(input.gyro_noise, 2 * ImuNoise{}.gyro_noise_rad_s_rtHz, 1e-15);
  EXPECT_NEAR(input.accel_walk, 2 * ImuNoise{}.accel_walk_m_s3_rtHz, 1e-15);
  const SegmentImage& image = segments_[0].instances[3].images.front();
  EXPECT_EQ(image.jitter_s, 0.003);
  EXPECT_EQ(image.tags.front().noise_px, EstimatorConfig{}.corner_noise_px);
  EXPECT_EQ(segments_[0].cameras[0].shift_s, 0);
  EXPECT_EQ(segments_[0].cameras[1].shift_s, 0.02);
  EXPECT_EQ(segments_[0].cameras[1].lens.focal, 0.01);
}

TEST_F(SegmentRecorderTest, WithoutImuStepsHaveOnlyADuration) {
  has_imu_ = false;
  recorder_ = SegmentRecorder(sensors_of(false), EstimatorConfig{});
  place(1);
  for (int i = 0; i < 12; ++i) {
    t_s_ += kImage_s;  // an image was lost
    image({1});
  }
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_FALSE(segments_[0].has_imu());
  for (std::size_t k = 1; k < segments_[0].instances.size(); ++k) {
    const auto& steps = segments_[0].instances[k].steps;
    ASSERT_EQ(steps.size(), 2u);
    for (const SegmentStep& step : steps) {
      EXPECT_FALSE(step.input.has_accelerometer);
      EXPECT_NEAR(step.dt_s, kImage_s, 1e-9);
      EXPECT_EQ(step.input.accel_noise, EstimatorConfig{}.motion_accel_m_s2_rtHz);
      EXPECT_EQ(step.input.gyro_walk, EstimatorConfig{}.motion_angular_rad_s2_rtHz);
    }
  }
}

}  // namespace
}  // namespace fiducap
