#include "scene/scene.hpp"

#include <gmock/gmock.h>

#include <random>
#include <thread>

#include "base/pose.hpp"
#include "scene/body_name.hpp"
#include "scene/scene_frame.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::Optional;

Instant at_ms(int ms) { return instant_from_ns(1'000'000'000) + std::chrono::milliseconds(ms); }

std::vector<SceneBody> two_bodies() {
  std::vector<SceneBody> bodies(2);
  bodies[0].description = {1, "alpha"};
  bodies[0].sensors.imu = ImuNoise{};
  bodies[1].description = {2, "beta"};
  bodies[1].X_BP.p = {0, 0, 0.1};
  return bodies;
}

BodyEstimate estimate(int ms) {
  BodyEstimate e;
  e.at = at_ms(ms);
  e.covariance = Matrix15d::Identity() * 1e-6;
  e.anchored = true;
  return e;
}

UpdateReport report(int ms) {
  UpdateReport r;
  r.exposed_at = at_ms(ms);
  r.tags_used = 2;
  return r;
}

class SceneTest : public testing::Test {
 protected:
  void ingest(std::size_t body, int ms) { scene_.ingest(body, estimate(ms), report(ms), {}, 0); }
  std::shared_ptr<const SceneFrame> sample(int ms, std::shared_ptr<const TagMap> map = nullptr) {
    return scene_.sample(at_ms(ms), at_ms(ms), {}, 200.0, std::move(map));
  }
  Scene scene_{two_bodies()};
};

TEST_F(SceneTest, PredictsEveryBodyToTheRequestedInstant) {
  ingest(1, 100);
  const auto map = std::make_shared<TagMap>();
  const auto frame = scene_.sample(at_ms(110), at_ms(111), Duration{5}, 200.0, map);
  EXPECT_EQ(frame->number, 1u);
  EXPECT_EQ(frame->at, at_ms(110));
  EXPECT_EQ(frame->published_at, at_ms(111));
  EXPECT_EQ(frame->utc_offset, Duration{5});
  EXPECT_EQ(frame->rate_hz, 200.0);
  EXPECT_EQ(frame->map, map);
  EXPECT_EQ(frame->model, scene_.model());
  ASSERT_EQ(frame->bodies.size(), 2u);
  EXPECT_EQ(frame->bodies[0].body_id, 1);
  EXPECT_EQ(frame->bodies[0].state, BodyState::kSearching);
  EXPECT_FALSE(frame->bodies[0].valid);
  EXPECT_EQ(frame->bodies[1].state, BodyState::kTracking);
  EXPECT_TRUE(frame->bodies[1].valid);
  EXPECT_NEAR(frame->bodies[1].X_WP.p.z(), 0.1, 1e-12);
  EXPECT_EQ(sample(115)->number, 2u);
}

TEST_F(SceneTest, DescribesAndRenamesBodiesInAModelPerGeneration) {
  ASSERT_EQ(scene_.model()->bodies.size(), 2u);
  EXPECT_EQ(scene_.model()->bodies[0].name, "alpha");
  EXPECT_EQ(scene_.model()->bodies[1].id, 2);
  const auto before = sample(110);
  scene_.rename(1, "gamma");
  EXPECT_EQ(before->model->bodies[1].name, "beta");
  EXPECT_EQ(scene_.model()->bodies[1].name, "gamma");
  EXPECT_EQ(scene_.model()->bodies[1].id, 2);
  EXPECT_EQ(scene_.list()[1].description.name, "gamma");
}

TEST_F(SceneTest, TracksADisabledBodyWithoutShowingIt) {
  scene_.set_enabled(0, false);
  ingest(0, 100);
  auto frame = sample(110);
  ASSERT_EQ(frame->bodies.size(), 1u);
  EXPECT_EQ(frame->bodies[0].body_id, 2);
  EXPECT_EQ(frame->model->bodies[0].name, "beta");
  EXPECT_EQ(frame->model->generation, 2u);
  scene_.set_enabled(0, true);
  frame = sample(110);
  EXPECT_EQ(frame->model->generation, 3u);
  EXPECT_EQ(frame->bodies[0].state, BodyState::kTracking);
  scene_.set_enabled(0, true);
  EXPECT_EQ(scene_.model()->generation, 3u) << "nothing changed";
}

TEST_F(SceneTest, MovesThePivot) {
  ingest(1, 100);
  scene_.set_pivot(1, {Eigen::Quaterniond::Identity(), {0.5, 0, 0}});
  EXPECT_NEAR(sample(100)->bodies[1].X_WP.p.x(), 0.5, 1e-12);
}

TEST_F(SceneTest, LosesOnlyTheBodyOfALostSource) {
  ingest(0, 100);
  ingest(1, 100);
  scene_.source_lost(0);
  const auto frame = sample(110);
  EXPECT_EQ(frame->bodies[0].state, BodyState::kLost);
  EXPECT_EQ(frame->bodies[1].state, BodyState::kTracking);
}

TEST_F(SceneTest, KeepsPublishedFramesUnchanged) {
  ingest(1, 100);
  const auto kept = sample(110);
  for (int i = 0; i < 5; ++i) (void)sample(6000 + i);
  EXPECT_EQ(kept->number, 1u);
  EXPECT_EQ(kept->at, at_ms(110));
  EXPECT_TRUE(kept->bodies[1].valid);
}

TEST_F(SceneTest, AllocatesNothingAfterWarmUp) {
  const auto map = std::make_shared<const TagMap>();
  std::shared_ptr<const SceneFrame> held;
  const auto steady = [&](int from, int to) {
    for (int ms = from; ms < to; ms += 5) {
      scene_.add_imu(0, {at_ms(ms), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
      for (std::size_t body = 0; ms % 50 == 0 && body < 2; ++body) ingest(body, ms - 30);
      held = sample(ms + 2, map);
    }
  };
  steady(0, 200);
  const AllocationCounter allocations;
  steady(200, 2000);
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_TRUE(held->bodies[0].valid);
}

// For the thread sanitizer: workers and publisher at the same time.
TEST_F(SceneTest, IsSafeForWorkersAndPublisher) {
  const auto worker = [this](std::size_t body) {
    for (int ms = 0; ms < 2000; ms += 5) {
      scene_.add_imu(body, {at_ms(ms), Eigen::Vector3d::Zero(), {0, 0, 9.81}});
      if (ms % 50 == 0) ingest(body, ms);
    }
  };
  std::thread first(worker, 0);
  std::thread second(worker, 1);
  std::uint64_t number = 0;
  for (int i = 0; i < 200; ++i) number = sample(10 * i)->number;
  first.join();
  second.join();
  EXPECT_EQ(number, 200u);
  const auto end = sample(1990);
  EXPECT_TRUE(end->bodies[0].valid);
  EXPECT_TRUE(end->bodies[1].valid);
}

constexpr double kRounding_px = 1e-9;

UpdateReport image(int at_ms, std::initializer_list<UpdateReport::CornerFit> fits) {
  UpdateReport report;
  report.exposed_at = instant_from_ns(std::int64_t{at_ms} * 1'000'000);
  for (const auto& fit : fits) report.name_fit(fit);
  return report;
}

TEST(TagFits, AreTheRootMeanSquareOfTheFirstSightings) {
  TagFits fits;
  fits.add(image(10, {{7, 3.0}, {2, 0.5}}));
  fits.add(image(20, {{7, 4.0}}));
  const auto all = fits.list();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].tag_id, 2) << "sorted";
  EXPECT_NEAR(all[1].rms_px, std::sqrt(12.5), kRounding_px);
  EXPECT_EQ(all[1].sightings, 2u);
  EXPECT_EQ(all[1].seen_at, instant_from_ns(20'000'000));
}

TEST(TagFits, ForgetOldSightingsAndAreBounded) {
  TagFits fits;
  fits.add(image(0, {{7, 100.0}}));
  for (int i = 1; i < 1000; ++i) fits.add(image(i, {{7, 0.3}}));
  EXPECT_NEAR(fits.list()[0].rms_px, 0.3, 1e-3);
  for (int id = 0; id < 2 * static_cast<int>(TagFits::kMostTags); ++id)
    fits.add(image(0, {{id, 1.0}}));
  EXPECT_EQ(fits.list().size(), TagFits::kMostTags);
}

TEST(TagFits, IgnoreAStartThatMayBeRevoked) {
  TagFits fits;
  auto open = image(0, {{7, 1.0}});
  open.start_is_open = true;
  fits.add(open);
  fits.add(image(0, {{8, std::numeric_limits<double>::quiet_NaN()}}));
  EXPECT_TRUE(fits.list().empty());
}

TEST(TagFits, AllocateNothingPerImage) {
  TagFits fits;
  const auto report = image(0, {{7, 1.0}, {8, 1.0}});
  fits.add(report);
  const AllocationCounter counter;
  for (int i = 0; i < 10; ++i) fits.add(report);
  EXPECT_EQ(counter.count(), 0u);
}

std::mt19937_64 random_numbers(20);

Eigen::Vector3d draw(double sigma) {
  std::normal_distribution<double> gauss(0, sigma);
  const double x = gauss(random_numbers);
  const double y = gauss(random_numbers);
  return {x, y, gauss(random_numbers)};
}

Pose drawn_alignment() { return {exp_so3({0, 0, draw(1).z()}), draw(3)}; }

std::shared_ptr<const TagMap> map_with_tags(const Pose& X_RW) {
  auto map = std::make_shared<TagMap>();
  map->X_RW = X_RW;
  for (int id : {3, 8}) {
    MapTag tag;
    tag.tag.tag_id = id;
    tag.tag.X_WT = {exp_so3(draw(1)), draw(2)};
    Matrix6d root;
    for (int k = 0; k < 12; ++k) root.block<3, 1>(3 * (k % 2), k / 2) = draw(0.01);
    tag.tag.covariance = root * root.transpose();
    map->tags.push_back(tag);
  }
  return map;
}

TEST(RoomAxes, AreThoseOfTheWorkspaceUntilTheMapIsAligned) {
  RoomAxes room;
  const auto map = map_with_tags({});
  EXPECT_EQ(room.set_map(map), map);
  BodyPose pose;
  pose.X_WP.p = {1, 2, 3};
  room.transform(pose);
  EXPECT_EQ(pose.X_WP.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(room.set_map(nullptr), nullptr);
  EXPECT_EQ(room.number(), 0u);
}

TEST(RoomAxes, ChangeWithTheAlignmentOnly) {
  RoomAxes room;
  const Pose X_RW = drawn_alignment();
  (void)room.set_map(map_with_tags({}));
  (void)room.set_map(map_with_tags(X_RW));
  EXPECT_EQ(room.number(), 1u);
  (void)room.set_map(map_with_tags(X_RW));
  EXPECT_EQ(room.number(), 1u);
  (void)room.set_map(map_with_tags({}));
  EXPECT_EQ(room.number(), 2u) << "rolled back";
}

TEST(RoomAxes, PreserveThePoseOfABodyRelativeToATag) {
  RoomAxes room;
  for (int k = 0; k < 50; ++k) {
    const auto map = map_with_tags(drawn_alignment());
    const auto moved = room.set_map(map);
    EXPECT_EQ(room.set_map(map), moved) << "a map is copied once";
    BodyPose pose;
    pose.X_WP = {exp_so3(draw(1)), draw(2)};
    const Pose X_PT = pose.X_WP.inverse() * map->tags[1].tag.X_WT;
    room.transform(pose);
    const Pose now = pose.X_WP.inverse() * moved->tags[1].tag.X_WT;
    EXPECT_LT((now.p - X_PT.p).norm(), 1e-12);
    EXPECT_LT(angle_between(now.q, X_PT.q), 1e-12);
    EXPECT_LT(((map->X_RW * map->tags[0].tag.X_WT).p - moved->tags[0].tag.X_WT.p).norm(), 1e-12);
    EXPECT_TRUE(moved->X_RW.p.isZero(0));
  }
}

TEST(RoomAxes, NeverTilt) {
  RoomAxes room;
  const Pose tilted{exp_so3({0, 0, 0.7}) * exp_so3({0.4, 0, 0}), {1, 2, 3}};
  const auto moved = room.set_map(map_with_tags(tilted));
  BodyPose pose;
  room.transform(pose);
  EXPECT_LT((pose.X_WP.q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_LT(angle_between(pose.X_WP.q, exp_so3({0, 0, 0.7})), 1e-12);
  EXPECT_EQ(pose.X_WP.p, Eigen::Vector3d(1, 2, 3));
}

/// Errors drawn in W and transformed have the covariance in R.
TEST(RoomAxes, RotateVelocitiesAndCovariances) {
  constexpr double kTiny = 1e-6;
  RoomAxes room;
  const auto map = map_with_tags(drawn_alignment());
  (void)room.set_map(map);
  BodyPose pose;
  pose.X_WP = {exp_so3(draw(1)), draw(2)};
  pose.v_WP = draw(1);
  pose.w_WP_P = draw(1);
  Matrix12d root;
  for (int k = 0; k < 48; ++k) root.block<3, 1>(3 * (k % 4), k / 4) = draw(kTiny);
  pose.covariance = root * root.transpose();
  BodyPose in_room = pose;
  room.transform(in_room);
  EXPECT_LT((in_room.v_WP - map->X_RW.q * pose.v_WP).norm(), 1e-12);
  EXPECT_EQ(in_room.w_WP_P, pose.w_WP_P) << "is in the body's own axes";
  // Each column of the root is an error; moved with the body it must be a column of the new root.
  Matrix12d moved;
  for (int k = 0; k < 12; ++k) {
    BodyPose off = pose;
    off.X_WP.p += root.block<3, 1>(0, k);
    off.X_WP.q = exp_so3(root.block<3, 1>(3, k)) * off.X_WP.q;
    off.v_WP += root.block<3, 1>(6, k);
    room.transform(off);
    moved.block<3, 1>(0, k) = off.X_WP.p - in_room.X_WP.p;
    moved.block<3, 1>(3, k) = log_so3(off.X_WP.q * in_room.X_WP.q.conjugate());
    moved.block<3, 1>(6, k) = off.v_WP - in_room.v_WP;
    moved.block<3, 1>(9, k) = root.block<3, 1>(9, k);
  }
  EXPECT_LT((moved * moved.transpose() - in_room.covariance).norm(), 1e-4 * kTiny * kTiny);
}

TEST_F(SceneTest, IsInRoomAxesWhenTheMapIsAligned) {
  BodyEstimate moved = estimate(0);
  moved.X_WB.p = {1, 0, 0};
  scene_.ingest(0, moved, report(0), {}, 0);
  const Pose X_RW{exp_so3({0, 0, M_PI / 2}), {0, 0, 5}};
  const auto map = map_with_tags(X_RW);
  const auto frame = sample(0, map);
  EXPECT_LT((frame->bodies[0].X_WP.p - Eigen::Vector3d(0, 1, 5)).norm(), 1e-12);
  EXPECT_EQ(frame->axes, 1u);
  EXPECT_LT((frame->map->tags[0].tag.X_WT.p - X_RW * map->tags[0].tag.X_WT.p).norm(), 1e-12);
}

TEST(BodyName, MayBeOfAnyScriptWithSpaces) {
  for (const char* name : {"drone", "left-arm v2.1", "Größe 1", "Crazyflie (blue)", "日本 1",
                           "дрон", "a+b", "_hidden", "1", "a.b"}) {
    EXPECT_EQ(body_name_fault(name), std::nullopt) << name;
  }
  EXPECT_EQ(body_name_fault(std::string(63, 'x')), std::nullopt);
}

TEST(BodyName, ReportsTheFaultOfAHostileOne) {
  const std::pair<std::string, const char*> kHostile[] = {
      {"", "must not be empty"},
      {std::string(64, 'x'), "at most 63 bytes, has 64"},
      {"a\u00a0b", "no other space than U+0020, has U+00A0"},
      {"a\u3000b", "no other space"},
      {"o\u0308l", "composed letters"},
      {"a\u2044b", "look like"},
      {"a\u201cb", "look like"},
      {"\uff1cb\uff1e", "look like"},
      {" a", "begin or end with a space"},
      {"a ", "begin or end with a space"},
      {"a  b", "two spaces"},
      {"..", "begin with . or -"},
      {"-rf", "begin with . or -"},
  };
  for (const auto& [name, fault] : kHostile)
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr(fault))) << shown_name(name);
  const std::pair<std::string, std::string> kInvisible[] = {
      {"a\nb", "U+000A"},     {"a\x1b[2J", "U+001B"},   {std::string("a\0b", 3), "U+0000"},
      {"a\x7f", "U+007F"},    {"a\xc2\x9bm", "U+009B"}, {"abc\u202egnp", "U+202E"},
      {"a\u2066b", "U+2066"}, {"a\u200bb", "U+200B"},   {"\ufeffa", "U+FEFF"},
      {"a\ue000", "U+E000"}};
  for (const auto& [name, code] : kInvisible)
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr("invisible characters, has " + code)));
  const std::pair<const char*, std::string> kForbidden[] = {
      {"a/b", "/"}, {"a\\b", "\\"}, {"a@b", "@"},  {"a\"b", "\""}, {"a'b", "'"}, {"<b>", "<"},
      {"a&b", "&"}, {"a,b", ","},   {"$(x)", "$"}, {"a;b", ";"},   {"a*", "*"}};
  for (const auto& [name, forbidden] : kForbidden)
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr("must not have " + forbidden)));
  for (const char* name : {"\xff", "a\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80"})
    EXPECT_THAT(body_name_fault(name), Optional(HasSubstr("must be UTF-8")));
}

TEST(BodyName, IsShownSoThatALineStaysALine) {
  EXPECT_EQ(shown_name("Größe 1"), "\"Größe 1\"");
  EXPECT_EQ(shown_name("a\x1b[2J\n"), "\"a\\x1b[2J\\x0a\"");
  EXPECT_EQ(shown_name("abc\u202egnp"), "\"abc\\u202egnp\"");
  EXPECT_EQ(shown_name("\xff"), "\"\\xff\"");
}

}  // namespace
}  // namespace fiducap
