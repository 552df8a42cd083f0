#include "daemon/control_desk.hpp"

#include <gtest/gtest.h>

#include "support/fake_clock.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

class ControlDeskTest : public testing::Test {
 protected:
  ControlDeskTest()
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
  Scene scene_;
  MapBuilder map_;
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
  SessionRecorder recorder_;
  int commits_{0};
  ControlDesk desk_{{"correct horse", {}}, scene_, map_, recorder_, events_,
                    [this] { ++commits_; }};
};

TEST_F(ControlDeskTest, KnowsTheOperatorByTheTokenAlone) {
  EXPECT_TRUE(desk_.admits("correct horse"));
  EXPECT_FALSE(desk_.admits("correct hors"));
  EXPECT_FALSE(desk_.admits("correct horsf"));
  EXPECT_FALSE(desk_.admits(""));
  const ControlDesk closed({}, scene_, map_, recorder_, events_, {});
  EXPECT_FALSE(closed.admits("")) << "no token: nobody is the operator";
}

TEST_F(ControlDeskTest, BodiesAreNamedByTheirStreamingId) {
  ASSERT_TRUE(desk_.set_enabled(7, false));
  EXPECT_EQ(scene_.model()->bodies.size(), 1u);
  EXPECT_FALSE(desk_.bodies()[1].enabled);
  EXPECT_EQ(desk_.set_enabled(5, false).error().code, ErrorCode::kNotFound);
}

TEST_F(ControlDeskTest, RefusesNamesThatNoProtocolOrNobodyElseCanBear) {
  EXPECT_TRUE(desk_.rename(4, "drone-2"));
  EXPECT_TRUE(desk_.rename(4, "drone-2")) << "its own name is free for itself";
  EXPECT_EQ(desk_.rename(4, "rover").error().code, ErrorCode::kInvalid);
  EXPECT_FALSE(desk_.rename(4, ""));
  EXPECT_FALSE(desk_.rename(4, "a@b"));
  EXPECT_FALSE(desk_.rename(4, std::string(64, 'a')));
  EXPECT_EQ(desk_.bodies()[0].name, "drone-2");
}

TEST_F(ControlDeskTest, EventsOfARenamedBodyBearItsNewName) {
  events_.begin({.subject = "drone", .kind = "silent", .text = "no image"});
  ASSERT_TRUE(desk_.rename(4, "uav1"));
  ASSERT_TRUE(desk_.rename(4, "uav2"));
  events_.begin({.subject = "drone", .kind = "tracking", .text = "is lost"});
  for (const Event& event : events_.standing()) EXPECT_EQ(event.subject, "uav2") << event.kind;
}

TEST_F(ControlDeskTest, APivotNeedsARotation) {
  Pose X_BP{Eigen::Quaterniond::Identity(), {1, 2, 3}};
  EXPECT_TRUE(desk_.set_pivot(4, X_BP));
  EXPECT_EQ(desk_.bodies()[0].X_BP.p, Eigen::Vector3d(1, 2, 3));
  X_BP.q.coeffs() *= 2;
  EXPECT_FALSE(desk_.set_pivot(4, X_BP));
  X_BP.q.coeffs().setConstant(std::nan(""));
  EXPECT_FALSE(desk_.set_pivot(4, X_BP));
}

TEST_F(ControlDeskTest, TheMapIsFrozenAndStoredOnRequest) {
  EXPECT_TRUE(desk_.set_map_mode(MapMode::kFrozen));
  EXPECT_EQ(map_.mode(), MapMode::kFrozen);
  EXPECT_TRUE(desk_.commit_map());
  EXPECT_EQ(commits_, 1);
  ControlDesk without_store({}, scene_, map_, recorder_, events_, {});
  EXPECT_EQ(without_store.commit_map().error().code, ErrorCode::kUnsupported);
}

TEST_F(ControlDeskTest, ARecordingWithoutANameIsCalledByTheTime) {
  ASSERT_TRUE(desk_.start_recording(""));
  EXPECT_EQ(desk_.recording()->size(), std::string("2026-01-01_00-00-00").size());
  EXPECT_FALSE(desk_.start_recording("another"));
  EXPECT_TRUE(desk_.stop_recording());
  EXPECT_FALSE(desk_.recording());
}

}  // namespace
}  // namespace fiducap
