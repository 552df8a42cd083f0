// Cutting what a body sees and feels into segments: nothing twice, nothing lost, and a new chain
// when the filter does not know any more how it came where it is.
#include "estimation/segment/segment_recorder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <utility>

#include "base/pose.hpp"
#include "known_motion.hpp"

namespace fiducap {
namespace {

constexpr double kImage_s = 0.05;
constexpr double kOffReadings_s = 0.0023;  // images do not fall on readings

/// A filter with given results.
class FakeFilter final : public BodyFilter {
 public:
  void propagate(const ImuSample&) override {}
  UpdateReport update(const TagObservations&, const MapKnowledge&) override { return {}; }
  void set_tag_priors(std::vector<KnownTag>) override {}
  void lose_motion() override {}
  void release_tag(int) override {}
  [[nodiscard]] bool running() const override { return is_running; }
  [[nodiscard]] BodyEstimate estimate() const override { return body; }
  void tag_beliefs(std::vector<TagBelief>& out) const override { out.clear(); }
  void own_tags(std::vector<TagBelief>& out) const override { out = tags; }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override { return cameras; }
  [[nodiscard]] ClockEstimate clock(int) const override { return {}; }
  [[nodiscard]] LearnedSensors learned(int) const override { return learned_sensors; }

  bool is_running{true};
  BodyEstimate body;
  std::vector<ExtrinsicsEstimate> cameras{2};
  LearnedSensors learned_sensors;
  std::vector<TagBelief> tags;  ///< In the state, also of a start that may be taken back.
};

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
  void image(const std::vector<int>& tags, int camera = 0,
             const std::function<void(UpdateReport&)>& change = nullptr) {
    t_s_ += kImage_s;
    while (has_imu_ && imu_s_ < t_s_ + kOffReadings_s) {
      imu_s_ += to_seconds(kImuPeriod);
      // The rate encodes the time of its reading: sums over steps can be checked.
      recorder_.add(ImuSample{at_s(imu_s_), {imu_s_, 0, 1}, {0, 0, kGravity}});
    }
    show(tags, camera, change);
  }

  /// Another image at the same moment.
  void show(const std::vector<int>& tags, int camera,
            const std::function<void(UpdateReport&)>& change = nullptr) {
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

  void images(int count, const std::vector<int>& tags) {
    for (int i = 0; i < count; ++i) image(tags);
  }

  void believe(int tag_id) {
    beliefs_.push_back({{tag_id, 0.2, X_WM_ * place_of(tag_id), {}}, 1, {}, {}, 0});
  }
  static Pose place_of(int tag_id) { return {exp_so3({0.3, 0, 0}), {2.0 + tag_id, 1, 1}}; }

  /// How often each corner that was shown is in a segment.
  [[nodiscard]] std::map<double, int> corners() const {
    std::map<double, int> count;
    for (const MotionSegment& segment : segments_)
      for (const auto& instance : segment.instances)
        for (const SegmentImage& image : instance.images)
          for (const SegmentSighting& s : image.tags) ++count[s.seen.corners_px[0].x()];
    return count;
  }

  static double seconds_of(const MotionSegment& segment) {
    return to_seconds(segment.end().at - segment.begin().at);
  }

  static std::vector<int> tags_of(const MotionSegment& segment) {
    std::vector<int> out;
    for (const KnownTag& tag : segment.tags) out.push_back(tag.tag_id);
    return out;
  }

  void without_imu() {
    has_imu_ = false;
    recorder_ = SegmentRecorder(sensors_of(false), EstimatorConfig{});
  }

  FakeFilter filter_;
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

TEST_F(SegmentRecorderTest, CutsAfterASecondWithoutGaps) {
  believe(1);
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
    EXPECT_TRUE(segments_[i].instances.front().images.empty()) << "the one before has them";
  }
  EXPECT_EQ(segments_[0].instances.front().images.size(), 1u) << "nobody before has them";
}

TEST_F(SegmentRecorderTest, HasEveryReadingOnceAndInOrder) {
  believe(1);
  images(70, {1});
  ASSERT_EQ(segments_.size(), 3u);
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
  believe(1);
  believe(2);
  for (int i = 0; i < 64; ++i) {
    image({1, 2}, 0);
    show({2}, 1);
  }
  ASSERT_EQ(segments_.size(), 3u);
  const auto count = corners();
  // After the first camera's image at which the last one ended: its own, and what came later.
  const int recorded = 3 * 61 - 1;
  EXPECT_EQ(count.size(), static_cast<std::size_t>(recorded));
  for (int i = 0; i < recorded; ++i) {
    ASSERT_TRUE(count.contains(i)) << i;
    EXPECT_EQ(count.at(i), 1) << i;
  }
}

TEST_F(SegmentRecorderTest, HoldsTheSegmentsOfAStartUntilItIsFinal) {
  const auto is_open = [](UpdateReport& r) { r.start_is_open = true; };
  believe(1);
  filter_.tags = std::exchange(beliefs_, {});  // none of it may be used
  for (int i = 0; i < 70; ++i) image({1}, 0, is_open);
  EXPECT_TRUE(segments_.empty());
  beliefs_ = filter_.tags;
  images(5, {1});
  EXPECT_EQ(segments_.size(), 3u) << "one with each image";
  EXPECT_EQ(corners().begin()->first, 0) << "from the first image on";
}

TEST_F(SegmentRecorderTest, DiscardsTheSegmentsOfAReplacedStart) {
  believe(1);
  filter_.tags = beliefs_;
  for (int i = 0; i < 70; ++i) image({1}, 0, [](UpdateReport& r) { r.start_is_open = true; });
  const int before = shown_;
  image({1}, 0, [](UpdateReport& r) { r.start_changed = true; });
  images(45, {1});
  ASSERT_FALSE(segments_.empty());
  for (const auto& [corner, times] : corners()) EXPECT_GE(corner, before);
}

TEST_F(SegmentRecorderTest, BeginsANewChainWhenTheFilterHasLostTheBody) {
  const std::map<std::string, std::function<void(UpdateReport&)>> breaks{
      {"forgotten", [](UpdateReport& r) { r.generation = 1; }},
      {"relocalised", [](UpdateReport& r) { r.relocalised = true; }},
      {"clock", [](UpdateReport& r) { r.clock_jump = UpdateReport::ClockJump{}; }},
      {"elsewhere", [](UpdateReport& r) { r.ambiguous_place = UpdateReport::AmbiguousPlace{}; }},
      {"stopped", [this](UpdateReport&) { filter_.is_running = false; }},
      {"by break_chain()", [this](UpdateReport&) { recorder_.break_chain(); }}};
  believe(1);
  for (const auto& [name, change] : breaks) {
    SCOPED_TRACE(name);
    segments_.clear();
    images(30, {1});
    ASSERT_FALSE(segments_.empty());
    const int chain = segments_.back().chain;
    segments_.clear();
    const int before = shown_;
    image({1}, 0, change);
    filter_.is_running = true;
    const auto goes_on = [](UpdateReport& r) { r.generation = 1; };
    for (int i = 0; i < 21; ++i) {
      if (name == "forgotten") {
        image({1}, 0, goes_on);
      } else {
        image({1});
      }
    }
    ASSERT_FALSE(segments_.empty());
    EXPECT_EQ(segments_.back().chain, chain + 1);
    EXPECT_EQ(segments_.back().instances.front().images.size(), 1u);
    for (const auto& [corner, times] : corners())
      EXPECT_GE(corner, before) << "what was before hangs on nothing any more";
    if (name == "forgotten") image({1});  // … and once more, back to where the test began
  }
}

TEST_F(SegmentRecorderTest, ATagWithALatePoseAddsAllItsSightings) {
  believe(1);
  images(12, {1, 7, 8});
  believe(7);
  images(10, {1, 7, 8});
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_THAT(tags_of(segments_[0]), testing::ElementsAre(1, 7)) << "8 never got one";
  std::map<int, int> sightings;
  for (const auto& instance : segments_[0].instances)
    for (const SegmentImage& image : instance.images)
      for (const SegmentSighting& s : image.tags) ++sightings[s.seen.tag_id];
  EXPECT_EQ(sightings[1], 21);
  EXPECT_EQ(sightings[7], 21);
}

TEST_F(SegmentRecorderTest, DropsImagesWithoutTagsButNotTheirReadings) {
  believe(1);
  image({1});
  images(5, {});
  images(5, {8});  // its place is unknown
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

TEST_F(SegmentRecorderTest, EndsOnlyAtAnImageWithAPlacedTag) {
  believe(1);
  images(10, {1});
  images(20, {});
  images(5, {8});
  EXPECT_TRUE(segments_.empty());
  image({1});
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_NEAR(seconds_of(segments_[0]), 35 * kImage_s, 1e-6);
}

TEST_F(SegmentRecorderTest, BeginsAtAPlacedTag) {
  images(10, {8});
  believe(1);
  images(22, {1});
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_EQ(segments_[0].begin().at, at_s(11 * kImage_s + kOffReadings_s));
}

TEST_F(SegmentRecorderTest, BeginsANewChainAfterTenSecondsWithoutATag) {
  believe(1);
  images(30, {1});
  ASSERT_EQ(segments_.size(), 1u);
  for (int i = 0; i < 220; ++i) image(i % 2 == 0 ? std::vector<int>{} : std::vector<int>{8});
  images(22, {1});
  ASSERT_EQ(segments_.size(), 2u);
  EXPECT_EQ(segments_[1].chain, segments_[0].chain + 1);
  EXPECT_NEAR(seconds_of(segments_[1]), 1.0, 1e-6);
}

TEST_F(SegmentRecorderTest, MovesAlongWhenTheWorkspaceIsRedefined) {
  constexpr double kRounding = 1e-12;
  const Pose G{exp_so3({0, 0, 1.2}), {3, -5, 1}};
  is_anchored_ = false;
  believe(1);
  images(5, {1, 2});
  believe(2);
  images(5, {1, 2});
  X_WM_ = G;
  is_anchored_ = true;
  beliefs_.clear();
  believe(1);  // 2 has left the state: its place is from before
  image({1, 2}, 0, [&](UpdateReport& r) { r.gauge_shift = G; });
  images(10, {1, 2});
  ASSERT_EQ(segments_.size(), 1u);
  EXPECT_TRUE(segments_[0].anchored);
  for (const auto& instance : segments_[0].instances) {
    const BodyEstimate truth = Motion::truth(to_seconds(instance.body.at - at_s(0)));
    EXPECT_LT((instance.body.X_WB.p - G * truth.X_WB.p).norm(), kRounding);
    EXPECT_LT(angle_between(instance.body.X_WB.q, G.q * truth.X_WB.q), 1e-7);
    EXPECT_LT((instance.body.v_WB - G.q * truth.v_WB).norm(), kRounding);
  }
  ASSERT_EQ(segments_[0].tags.size(), 2u);
  for (const KnownTag& tag : segments_[0].tags)
    EXPECT_LT((tag.X_WT.p - (G * place_of(tag.tag_id)).p).norm(), kRounding) << tag.tag_id;
}

TEST_F(SegmentRecorderTest, UsesPosesOfTheMapOnlyInTheMapsAxesAndAfterItsOwn) {
  known_.push_back({1, 0.2, {Eigen::Quaterniond::Identity(), {9, 9, 9}}, {}});
  known_.push_back({3, 0.2, place_of(3), {}});
  is_anchored_ = false;
  images(30, {3});
  EXPECT_TRUE(segments_.empty()) << "its axes are not the map's";
  is_anchored_ = true;
  believe(1);
  images(22, {1, 3});
  ASSERT_EQ(segments_.size(), 1u);
  ASSERT_THAT(tags_of(segments_[0]), testing::ElementsAre(1, 3));
  EXPECT_EQ(segments_[0].tags[0].X_WT.p, place_of(1).p);
  EXPECT_EQ(segments_[0].tags[1].X_WT.p, place_of(3).p);
}

TEST_F(SegmentRecorderTest, UsesTheNoisesAndCamerasLearnedByTheFilter) {
  believe(1);
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

TEST_F(SegmentRecorderTest, WithoutImuHasOnlyItsDuration) {
  without_imu();
  believe(1);
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
