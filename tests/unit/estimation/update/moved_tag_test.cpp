// The only visible tag was moved, or the filter has diverged.
#include <gtest/gtest.h>

#include "example_room.hpp"

namespace fiducap {
namespace {

constexpr double kGood_m = 0.02;
const Eigen::Vector3d kMoved(0.5, 0, 0);

/// A body whose only visible tag, number 2, is moved after the start.
struct MovedTag {
  MovedTag() {
    room.images(160);
    EXPECT_TRUE(room.filter->running());
    move(kMoved);
  }
  void move(const Eigen::Vector3d& by) { room.tags[2].p += by; }
  UpdateReport images(int count) { return room.images(count, {}, {2}); }
  ExampleRoom room{{}};
};

TEST(MovedTagAlone, IncreasesTheSigmaByItsOffset) {
  MovedTag body;
  const UpdateReport report = body.images(15);
  ASSERT_TRUE(report.ambiguous_place);
  EXPECT_EQ(report.ambiguous_place->tag_id, 2);
  EXPECT_NEAR(report.ambiguous_place->by_m, kMoved.norm(), 0.1 * kMoved.norm());
  EXPECT_NEAR(body.room.sigma_m(), kMoved.norm(), 0.2 * kMoved.norm());
  EXPECT_TRUE(body.images(30).ambiguous_place) << "dropped meanwhile";
  EXPECT_FALSE(body.room.next_image({}, {2, 3}).ambiguous_place) << "another tag decides";
  const Eigen::Vector3d variance = body.room.filter->estimate().covariance.diagonal().head<3>();
  EXPECT_LT(variance.cwiseSqrt().sum(), 3 * kGood_m);
}

TEST(MovedTagAlone, IsAcceptedAfterManyConsistentImages) {
  MovedTag body;
  EXPECT_TRUE(body.images(200).ambiguous_place);
  EXPECT_FALSE(body.images(600).ambiguous_place);
}

TEST(MovedTagAlone, IsAcceptedAlthoughOneImageDidNotFit) {
  MovedTag body;
  EXPECT_TRUE(body.images(500).ambiguous_place);
  body.move(kMoved);
  EXPECT_EQ(body.images(1).tags_used, 0) << "rejected";
  body.move(-kMoved);
  EXPECT_FALSE(body.images(300).ambiguous_place);
}

}  // namespace
}  // namespace fiducap
