#include "daemon/operator_service.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"
#include "unit/daemon/certain_belief.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

class OperatorServiceTest : public testing::Test {
 protected:
  OperatorServiceTest()
      : scene_(bodies()),
        map_(MapConfig{}, TagMap{}),
        recorder_(RecorderConfig{folder_.file("recordings"), false}, clock_, events_) {}

  static std::vector<SceneBody> bodies() {
    std::vector<SceneBody> all(2);
    all[0].description = {4, "drone"};
    all[1].description = {7, "rover"};
    return all;
  }

  TemporaryFolder folder_;
  void map_tag(int id) {
    const TagBelief one = belief(id, 1.0);
    map_.absorb({.body_id = 1, .beliefs = std::span(&one, 1)}, 1'700'000'000'000'000'000);
  }

  Scene scene_;
  MapBuilder map_;
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
  SessionRecorder recorder_;
  std::string store_{folder_.file("hall.map")};
  MapKeeper keeper_{MapStore::open(store_).value(),           map_, 10.0, clock_, events_,
                    [] {
                      return std::vector<LearnedBody>{}; }};
  OperatorService service_{{"correct horse", {}}, scene_, map_, recorder_, events_, &keeper_};
};

TEST_F(OperatorServiceTest, KnowsTheOperatorByTheTokenAlone) {
  EXPECT_TRUE(service_.admits("correct horse"));
  EXPECT_FALSE(service_.admits("correct hors"));
  EXPECT_FALSE(service_.admits("correct horsf"));
  EXPECT_FALSE(service_.admits(""));
  const OperatorService closed({}, scene_, map_, recorder_, events_, nullptr);
  EXPECT_FALSE(closed.admits("")) << "no token: nobody is the operator";
}

TEST_F(OperatorServiceTest, BodiesAreNamedByTheirStreamingId) {
  ASSERT_TRUE(service_.set_enabled(7, false));
  EXPECT_EQ(scene_.model()->bodies.size(), 1u);
  EXPECT_FALSE(service_.bodies()[1].enabled);
  EXPECT_EQ(service_.set_enabled(5, false).error().code, ErrorCode::kNotFound);
}

TEST_F(OperatorServiceTest, RefusesNamesThatNoProtocolOrNobodyElseCanBear) {
  EXPECT_TRUE(service_.rename(4, "drone-2"));
  EXPECT_TRUE(service_.rename(4, "drone-2")) << "its own name is free for itself";
  EXPECT_EQ(service_.rename(4, "rover").error().code, ErrorCode::kInvalid);
  EXPECT_FALSE(service_.rename(4, ""));
  EXPECT_FALSE(service_.rename(4, "a@b"));
  EXPECT_FALSE(service_.rename(4, std::string(64, 'a')));
  EXPECT_EQ(service_.bodies()[0].name, "drone-2");
  EXPECT_TRUE(service_.rename(4, "Größe 1"));
  EXPECT_EQ(service_.bodies()[0].name, "Größe 1");
}

TEST_F(OperatorServiceTest, EventsOfARenamedBodyBearItsNewName) {
  events_.begin({.subject = "drone", .kind = "silent", .text = "no image"});
  ASSERT_TRUE(service_.rename(4, "uav1"));
  ASSERT_TRUE(service_.rename(4, "uav2"));
  events_.begin({.subject = "drone", .kind = "tracking", .text = "is lost"});
  for (const Event& event : events_.standing()) EXPECT_EQ(event.subject, "uav2") << event.kind;
}

TEST_F(OperatorServiceTest, APivotNeedsARotation) {
  Pose X_BP{Eigen::Quaterniond::Identity(), {1, 2, 3}};
  EXPECT_TRUE(service_.set_pivot(4, X_BP));
  EXPECT_EQ(service_.bodies()[0].X_BP.p, Eigen::Vector3d(1, 2, 3));
  X_BP.q.coeffs() *= 2;
  EXPECT_FALSE(service_.set_pivot(4, X_BP));
  X_BP.q.coeffs().setConstant(std::nan(""));
  EXPECT_FALSE(service_.set_pivot(4, X_BP));
}

TEST_F(OperatorServiceTest, AMapWithoutTagsIsNotFrozen) {
  const auto frozen = service_.set_map_mode(MapMode::kFrozen);
  ASSERT_FALSE(frozen);
  EXPECT_THAT(frozen.error().what, HasSubstr("no tag in the map yet"));
  EXPECT_EQ(map_.mode(), MapMode::kMapping);
}

TEST_F(OperatorServiceTest, TheMapIsFrozenAndStoredOnRequest) {
  map_tag(9);
  EXPECT_TRUE(service_.set_map_mode(MapMode::kFrozen));
  EXPECT_EQ(map_.mode(), MapMode::kFrozen);
  EXPECT_TRUE(service_.change_map(CommitVersion{"as it was"}));
  keeper_.commit();
  keeper_.update_cache();
  ASSERT_EQ(service_.map_versions().size(), 1U);
  EXPECT_EQ(service_.map_versions().front().comment, "as it was");
  OperatorService without_store({}, scene_, map_, recorder_, events_, nullptr);
  EXPECT_EQ(without_store.change_map(CommitVersion{}).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(without_store.change_map(RollBack{1}).error().code, ErrorCode::kUnavailable)
      << "frozen, first of all";
  EXPECT_TRUE(without_store.map_versions().empty());
}

TEST_F(OperatorServiceTest, WhatCannotBeDoneToTheMapIsRefusedAtOnce) {
  const auto why = [&](const MapChange& change) {
    const auto done = service_.change_map(change);
    return done ? std::string() : done.error().what;
  };
  EXPECT_THAT(why(RollBack{7}), HasSubstr("there is no version 7 in the store"));
  EXPECT_THAT(why(NameVersion{7, "x"}), HasSubstr("there is no version 7"));
  EXPECT_THAT(why(NameVersion{1, "two\nlines"}), HasSubstr("1 to 200 characters"));
  EXPECT_THAT(why(CommitVersion{kAutomaticComment}), HasSubstr("stored by itself"));
  EXPECT_THAT(why(QuarantineTag{3}), HasSubstr("has no tag 3"));
  EXPECT_THAT(why(ForgetTag{3}), HasSubstr("has no tag 3"));
  EXPECT_THAT(why(AlignMap{{{3, Eigen::Vector3d::Zero()}}}), HasSubstr("tag 3 is not in version"));
  map_tag(9);
  ASSERT_TRUE(service_.set_map_mode(MapMode::kFrozen));
  EXPECT_THAT(why(RollBack{7}), HasSubstr("the map is frozen"));
}

TEST_F(OperatorServiceTest, WhatAnOperatorDoesToTagsIsTold) {
  for (const int id : {3, 4, 5}) {
    TagBelief one = belief(id, 1.0);
    one.tag.X_WT.p.x() = id;
    one.tag.X_WT.p.y() = id == 4 ? 2 : 0;
    map_.absorb({.body_id = 1, .beliefs = std::span(&one, 1)}, 1'700'000'000'000'000'000);
  }
  ASSERT_EQ(map_.snapshot()->tags.size(), 3U);
  AlignMap align;
  for (const MapTag& tag : map_.snapshot()->tags)
    align.places.push_back({tag.tag.tag_id, tag.tag.X_WT.p + Eigen::Vector3d(10, 20, 0)});
  EXPECT_TRUE(service_.change_map(align));
  EXPECT_NEAR(map_.snapshot()->X_RW.p.y(), 20, 1e-9);
  EXPECT_TRUE(service_.change_map(QuarantineTag{3}));
  EXPECT_TRUE(service_.change_map(ForgetTag{4}));
  std::vector<std::string> kinds;
  for (const Event& event : events_.after(0)) kinds.push_back(event.kind);
  EXPECT_EQ(kinds, (std::vector<std::string>{"aligned", "tag_quarantined", "tag_forgotten"}));
}

TEST_F(OperatorServiceTest, ARecordingWithoutANameIsCalledByTheTime) {
  ASSERT_TRUE(service_.start_recording(""));
  EXPECT_EQ(service_.recording()->size(), std::string("2026-01-01_00-00-00").size());
  EXPECT_FALSE(service_.start_recording("another"));
  EXPECT_TRUE(service_.stop_recording());
  EXPECT_FALSE(service_.recording());
}

}  // namespace
}  // namespace fiducap
