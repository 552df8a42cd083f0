#include "streaming/vicon/frame_board.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/pose.hpp"
#include "client_packets.hpp"
#include "stream_view.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vicon {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;
using testing::SizeIs;

Instant at_s(double s) { return instant_from_ns(std::llround(s * 1e9)); }

TEST(ViconFrameNumbers, AreTimeTimesRateAlsoForLateTicks) {
  for (const double rate_hz : {25.0, 100.0, 200.0, 1000.0}) {
    FrameNumbers numbers;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> late(0.0, 0.7);  // of a period
    for (int i = 0; i < 5000; ++i) {
      const double tick = i + (i == 0 ? 0.0 : late(random));
      EXPECT_EQ(numbers.next(at_s(5 + tick / rate_hz), rate_hz), static_cast<std::uint32_t>(i))
          << rate_hz;
    }
  }
}

TEST(ViconFrameNumbers, AreDueEvenlySpacedAlsoForLateTicks) {
  FrameNumbers numbers;
  (void)numbers.next(at_s(3.0), 200);
  EXPECT_EQ(numbers.due(), at_s(3.0));
  (void)numbers.next(at_s(3.0081), 200);
  EXPECT_EQ(numbers.due(), at_s(3.005));
  (void)numbers.next(at_s(3.0101), 200);
  EXPECT_EQ(numbers.due(), at_s(3.010));
  (void)numbers.next(at_s(3.05), 400);
  EXPECT_EQ(numbers.due(), at_s(3.05)) << "a new rate starts at its tick";
}

TEST(ViconFrameNumbers, AreNotShiftedByALateFirstTick) {
  FrameNumbers numbers;
  EXPECT_EQ(numbers.next(at_s(1.006), 100), 0u);  // 6 ms late
  for (std::uint32_t i = 1; i < 100; ++i)
    EXPECT_LE(std::abs(static_cast<int>(numbers.next(at_s(1 + i * 0.01), 100) - i)), 1);
  EXPECT_EQ(numbers.next(at_s(2.006), 100), 100u);
}

TEST(ViconFrameNumbers, LeaveGapsAndAscendAlways) {
  struct Tick {
    double s, rate_hz;
    std::uint32_t number;
  };
  const std::vector<Tick> kMissed{{1.00, 100, 0}, {1.01, 100, 1}, {1.05, 100, 5}};
  const std::vector<Tick> kBackwards{{1.0, 100, 0}, {1.0, 100, 1}, {0.5, 100, 2}};
  const std::vector<Tick> kNewRate{{1.0, 100, 0}, {1.01, 100, 1}, {1.02, 200, 2}, {1.03, 200, 4}};
  for (const auto& ticks : {kMissed, kBackwards, kNewRate}) {
    FrameNumbers numbers;
    for (const auto& [s, rate_hz, number] : ticks)
      EXPECT_EQ(numbers.next(at_s(s), rate_hz), number) << s;
  }
}

TEST(ViconFrameNumbers, StayWithinAnInt) {
  FrameNumbers numbers;
  (void)numbers.next(at_s(0), 1000);
  EXPECT_EQ(numbers.next(instant_from_ns(2'147'483'647'000'000), 1000), 0x7fffffffu);
  EXPECT_EQ(numbers.next(instant_from_ns(2'147'483'648'000'000), 1000), 0u);
}

constexpr double kRounding_mm = 1e-9;
constexpr double kFloat_mm = 1e-3;  // of a few metres in millimetres
constexpr Duration kLate = std::chrono::milliseconds(4);

std::shared_ptr<const Profile> profile_of(const std::set<std::uint32_t>& types,
                                          SubjectFilter filter = {}) {
  Profile profile;
  for (const auto type : types) profile.types.add(type);
  profile.filter = std::move(filter);
  return std::make_shared<const Profile>(std::move(profile));
}

/// A client that takes every frame, by default with the statics.
class ViconFrameBoardTest : public testing::Test {
 protected:
  ViconFrameBoardTest() {
    view_.greeted = true;
    for (const Type type : kOffered) view_.offered.insert(static_cast<std::uint32_t>(type));
    request(client::kSegments);
  }
  void request(const std::set<std::uint32_t>& types, SubjectFilter filter = {}) {
    view_.requested = types;
    profile_ = profile_of(types, std::move(filter));
  }
  void next(const SceneFrame& frame, bool statics = true) {
    const Instant now = frame.published_at + waited_before_;
    board_.update(frame, now);
    const auto bytes = board_.packet(profile_, statics, now);
    EXPECT_EQ(view_.take(*bytes), bytes->size());
    EXPECT_THAT(view_.violations, IsEmpty());
  }

  FrameBoard board_{WhenInvalid::kFlag};
  std::shared_ptr<const Profile> profile_;
  StreamView view_;
  Duration waited_before_{};
};

TEST_F(ViconFrameBoardTest, LaterFramesKeepTheStaticsOfTheFirst) {
  const auto frame = make_scene_frame({"arm", "drone"}, 12);
  next(*frame);
  EXPECT_THAT(view_.names, ElementsAre(Pair(1, "arm"), Pair(2, "drone")));
  EXPECT_EQ(view_.rate_hz, 100.0);
  EXPECT_EQ(view_.up, 0);
  EXPECT_EQ(view_.hardware_number, 12u);
  EXPECT_THAT(view_.topologies, ElementsAre(1, 2));
  EXPECT_THAT(view_.scales, ElementsAre(1, 2));
  EXPECT_THAT(view_.rates, ElementsAre(Pair("Camera", 20.0), Pair("Stream", 100.0)));
  ASSERT_THAT(view_.globals, SizeIs(2));
  const Eigen::Map<const Eigen::Vector3d> t(view_.globals[2].t.data());
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(view_.globals[2].R.data());
  EXPECT_LT((t - Eigen::Vector3d(2000, -2000, 500)).norm(), kRounding_mm);
  EXPECT_LT((R - frame->bodies[1].X_WP.rotation()).norm(), 1e-12);
  EXPECT_EQ(view_.locals[2].t, view_.globals[2].t);
  EXPECT_EQ(view_.locals[2].R, view_.globals[2].R);
  EXPECT_NEAR(view_.qualities[1], 0.8, 1e-12) << "1 cm is a quarter of the half-good variance";
  next(*make_scene_frame({"arm", "drone"}, 13), false);
  EXPECT_EQ(view_.frames_with_statics, 1);
  EXPECT_THAT(view_.names, ElementsAre(Pair(1, "arm"), Pair(2, "drone")));
  EXPECT_EQ(view_.rate_hz, 100.0);
  EXPECT_THAT(view_.qualities, SizeIs(2));
}

TEST_F(ViconFrameBoardTest, LightweightSegmentsCarryTheSamePose) {
  request(client::kLight);
  const auto frame = make_scene_frame({"arm"});
  next(*frame);
  EXPECT_THAT(view_.globals, IsEmpty());
  ASSERT_THAT(view_.lights, SizeIs(1));
  const auto& light = view_.lights[1];
  EXPECT_NEAR(light.t[0], 1000, kFloat_mm);
  EXPECT_NEAR(light.t[1], -2000, kFloat_mm);
  const Eigen::Vector3d r(light.r[0], light.r[1], light.r[2]);
  EXPECT_LT(angle_between(exp_so3(r), frame->bodies[0].X_WP.q), 1e-6);
}

TEST_F(ViconFrameBoardTest, OccludesAnInvalidBody) {
  auto frame = make_scene_frame({"arm", "drone"});
  frame->bodies[0].valid = false;
  next(*frame);
  EXPECT_THAT(view_.names, SizeIs(2));
  EXPECT_FALSE(view_.globals.contains(1));
  EXPECT_TRUE(view_.globals.contains(2));
  EXPECT_EQ(view_.qualities[1], 0.0);
}

TEST_F(ViconFrameBoardTest, ShowsAnAliasUnderTheSameId) {
  board_ = FrameBoard(WhenInvalid::kFlag, {{"drone", "cf 7"}});
  next(*make_scene_frame({"arm", "drone"}));
  EXPECT_THAT(view_.names, ElementsAre(Pair(1, "arm"), Pair(2, "cf_7")));
}

TEST_F(ViconFrameBoardTest, SendsOnlyTheSubjectsOfAFilter) {
  request(client::kSegments, {{Type::kGlobalSegments, {2, 7}}, {Type::kObjectQuality, {1}}});
  next(*make_scene_frame({"a", "b", "c"}));
  EXPECT_THAT(view_.names, SizeIs(3));
  EXPECT_THAT(view_.globals, SizeIs(1));
  EXPECT_TRUE(view_.globals.contains(2));
  EXPECT_THAT(view_.locals, SizeIs(3)) << "a type without an entry is unrestricted";
  EXPECT_THAT(view_.qualities, ElementsAre(Pair(1, testing::_)));
  request(client::kSegments,
          {{Type::kSubjectInfo, {1}}, {Type::kGlobalSegments, {1}}, {Type::kLocalSegments, {}}});
  next(*make_scene_frame({"a", "b", "c"}, 2));
  EXPECT_THAT(view_.names, ElementsAre(Pair(1, "a")));
  EXPECT_THAT(view_.locals, IsEmpty());
}

TEST_F(ViconFrameBoardTest, EachChangeOfRateOrSubjectsIsAVersionOfTheStatics) {
  auto frame = make_scene_frame({"a", "b"});
  next(*frame);
  EXPECT_EQ(board_.statics_version(), 1u);
  frame->rate_hz = 250;
  next(*frame);
  EXPECT_EQ(board_.statics_version(), 2u);
  EXPECT_EQ(view_.rate_hz, 250.0);
  const auto changed = [&](std::vector<BodyDescription> bodies) {
    auto later = make_scene_frame({"x", "y", "z"}, ++frame->number + 1);
    later->bodies.resize(bodies.size());
    for (std::size_t i = 0; i < bodies.size(); ++i) later->bodies[i].body_id = bodies[i].id;
    later->model = std::make_shared<SceneModel>(SceneModel{frame->number, std::move(bodies)});
    next(*later);
  };
  changed({{1, "a"}, {2, "renamed"}});
  EXPECT_THAT(view_.names, ElementsAre(Pair(1, "a"), Pair(2, "renamed")));
  changed({{1, "a"}, {2, "renamed"}, {9, "new"}});
  EXPECT_THAT(view_.names, ElementsAre(Pair(1, "a"), Pair(2, "renamed"), Pair(9, "new")));
  changed({{9, "new"}});
  EXPECT_THAT(view_.names, ElementsAre(Pair(9, "new")));
  EXPECT_THAT(view_.qualities, ElementsAre(Pair(9, testing::_)));
  EXPECT_EQ(board_.statics_version(), 5u);
  changed({});
  EXPECT_THAT(view_.names, IsEmpty());
  next(*make_scene_frame({}, 50), false);
  EXPECT_EQ(view_.rate_hz, 100.0) << "kept although there are no subjects";
}

TEST_F(ViconFrameBoardTest, StopListsABodyOnlyWhileItIsTracked) {
  board_ = FrameBoard(WhenInvalid::kStop);
  auto frame = make_scene_frame({"a", "b"});
  next(*frame);
  const auto version = board_.statics_version();
  frame->bodies[0].valid = false;
  next(*frame);
  EXPECT_EQ(board_.statics_version(), version + 1);
  EXPECT_THAT(view_.names, ElementsAre(Pair(2, "b")));
  frame->bodies[0].valid = true;
  next(*frame);
  EXPECT_THAT(view_.names, SizeIs(2));
}

TEST_F(ViconFrameBoardTest, LatencyIsTheAgeOfTheSentPoseAndNeverNegative) {
  auto frame = make_scene_frame({"a"});
  frame->published_at = frame->at + std::chrono::milliseconds(3);
  waited_before_ = std::chrono::milliseconds(1);
  next(*frame);
  EXPECT_THAT(view_.latency, ElementsAre(Pair("Frame", 0.003), Pair("Output", 0.001)));
  const auto late = board_.packet(profile_, false, frame->published_at + waited_before_ + kLate);
  StreamView other = view_;
  other.frame_id = 0;
  other.frames = 0;
  other.take(*late);
  EXPECT_EQ(other.latency[1].first, "Output");
  EXPECT_DOUBLE_EQ(other.latency[1].second, 0.005);
  EXPECT_THAT(other.violations, IsEmpty());
  frame->published_at = frame->at - std::chrono::milliseconds(3);
  waited_before_ = -std::chrono::milliseconds(1);
  next(*frame);
  EXPECT_THAT(view_.latency, ElementsAre(Pair("Frame", 0.0), Pair("Output", 0.0)));
}

TEST_F(ViconFrameBoardTest, EveryFrameHasItsOwnTimecode) {
  std::set<std::string> seen;
  for (int i = 0; i < 100; ++i) {
    auto frame = make_scene_frame({"a"}, static_cast<std::uint64_t>(i));
    frame->at += std::chrono::microseconds(i % 3 == 0 ? 6900 : 100);  // of 10 ms
    next(*frame, i == 0);
    EXPECT_TRUE(seen.insert(view_.timecode).second) << i;
  }
}

TEST_F(ViconFrameBoardTest, EqualProfilesShareTheirBytes) {
  const auto frame = make_scene_frame({"a"});
  board_.update(*frame, frame->published_at);
  const auto profile = profile_of(client::kSegments);
  const auto light = profile_of(client::kLight);
  const auto first = board_.packet(profile, false, frame->published_at);
  EXPECT_EQ(board_.packet(profile, false, frame->published_at), first);
  EXPECT_NE(board_.packet(profile, true, frame->published_at), first);
  EXPECT_NE(board_.packet(light, false, frame->published_at), first);
}

TEST_F(ViconFrameBoardTest, SendsOnlyRequestedTypes) {
  request({5, 26, 901, 100004});
  next(*make_scene_frame({"a"}));
  EXPECT_THAT(view_.names, IsEmpty());
  request({5, 100004});
  next(*make_scene_frame({"a"}, 2), false);
}

constexpr double kRounding = 1e-12;  // of products of numbers around 1
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

class ViconSubjectPoses : public testing::Test {
 protected:
  static SubjectPoses make(WhenInvalid when_invalid) {
    return SubjectPoses(conventions_of("vicon").axes, when_invalid);
  }
  void update() { poses_.update(*frame_); }
  [[nodiscard]] const auto& first() const { return poses_.all()[0]; }
  BodyPose& body() { return frame_->bodies[0]; }

  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"a", "b"});
  SubjectPoses poses_ = make(WhenInvalid::kFlag);
};

TEST_F(ViconSubjectPoses, RotateSegmentPointsIntoTheWorldInMillimetres) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  for (int i = 0; i < 200; ++i) {
    // Also attitudes half a turn away, tiny ones, and quaternions with a negative real part.
    Pose& X_WP = body().X_WP;
    X_WP = {exp_so3((i % 4 == 0 ? 1e-9 : 2.0) * vector()), 5 * vector()};
    if (i % 2 == 0) X_WP.q.coeffs() *= -1;
    update();
    const SegmentPose& segment = first().segment;
    const Eigen::Vector3d p_P = vector();
    const Eigen::Vector3d p_W_mm = 1000 * (X_WP * p_P);
    EXPECT_LT((segment.R * (1000 * p_P) + segment.t_mm - p_W_mm).norm(), kRounding_mm);
    EXPECT_LT((exp_so3(segment.rotation_vector).toRotationMatrix() - segment.R).norm(),
              1e3 * kRounding);
    EXPECT_LE(segment.rotation_vector.norm(), M_PI + kRounding);
    EXPECT_NEAR(segment.R.determinant(), 1.0, kRounding);
    EXPECT_LT((segment.R * segment.R.transpose() - Eigen::Matrix3d::Identity()).norm(), kRounding);
  }
}

TEST_F(ViconSubjectPoses, RepeatTheLastValidPoseWithHold) {
  poses_ = make(WhenInvalid::kHold);
  body().valid = false;
  update();
  EXPECT_FALSE(first().visible) << "no pose yet";
  body().valid = true;
  update();
  const Eigen::Vector3d seen = first().segment.t_mm;
  body().valid = false;
  body().X_WP.p += Eigen::Vector3d::Ones();
  update();
  EXPECT_TRUE(first().visible);
  EXPECT_EQ(first().segment.t_mm, seen);
  EXPECT_EQ(first().quality, 0.0);
  frame_->axes = 1;
  update();
  EXPECT_FALSE(first().visible) << "held in axes that are no longer those of the room";
}

TEST_F(ViconSubjectPoses, NonFiniteNumbersMakeABodyInvalid) {
  body().X_WP.p.x() = kNotANumber;
  frame_->bodies[1].X_WP.q.w() = std::numeric_limits<double>::infinity();
  update();
  EXPECT_FALSE(first().visible);
  EXPECT_FALSE(poses_.all()[1].visible);
}

TEST_F(ViconSubjectPoses, QualityDecreasesFromOneWithTheCovariance) {
  BodyPose one;
  one.valid = true;
  EXPECT_EQ(quality_of(one), 1.0);
  one.covariance.block<3, 3>(0, 0) = Eigen::Matrix3d::Identity() * 0.02 * 0.02;
  EXPECT_NEAR(quality_of(one), 0.5, kRounding);
  one.covariance.block<3, 3>(3, 3) = Eigen::Matrix3d::Identity() * 0.04 * 0.04;
  EXPECT_NEAR(quality_of(one), 0.2, kRounding) << "the worse of the two counts";
  one.covariance(0, 0) = kNotANumber;
  EXPECT_GE(quality_of(one), 0.0);
  one.valid = false;
  EXPECT_EQ(quality_of(one), 0.0);
}

}  // namespace
}  // namespace fiducap::vicon
