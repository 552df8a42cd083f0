// A tag was moved while a body saw nothing else: it was moved, or the filter diverged.
#include <gtest/gtest.h>

#include "example_room.hpp"

namespace fiducap {
namespace {

constexpr double kGood_m = 0.02;
const Eigen::Vector3d kMoved(0.5, 0, 0);

/// In a room of its own making, past the seconds in which a filter may take its start back.
void settle(ExampleRoom& room) {
  for (int i = 0; i < 160; ++i) room.next_image({});
  ASSERT_TRUE(room.filter->running());
}

/// Root of the covariance along an axis.
double sigma_m(const ExampleRoom& room, int axis) {
  return std::sqrt(room.filter->estimate().covariance(axis, axis));
}

TEST(MovedTagAlone, IncreasesTheSigmaByItsOffset) {
  ExampleRoom room({});
  settle(room);
  room.tags[2].p += kMoved;
  UpdateReport report;
  for (int i = 0; i < 15; ++i) report = room.next_image({}, {2});
  ASSERT_TRUE(report.ambiguous_place);
  EXPECT_EQ(report.ambiguous_place->tag_id, 2);
  EXPECT_NEAR(report.ambiguous_place->by_m, kMoved.norm(), 0.1 * kMoved.norm());
  const Matrix15d P = room.filter->estimate().covariance;
  EXPECT_NEAR(std::sqrt(P.diagonal().head<3>().sum()), kMoved.norm(), 0.2 * kMoved.norm());
  for (int i = 0; i < 30; ++i) report = room.next_image({}, {2});  // given up meanwhile
  EXPECT_TRUE(report.ambiguous_place);
  report = room.next_image({}, {2, 3});
  EXPECT_FALSE(report.ambiguous_place) << "another one decides";
  EXPECT_LT(sigma_m(room, 0) + sigma_m(room, 1) + sigma_m(room, 2), 3 * kGood_m);
}

TEST(MovedTagAlone, IsAcceptedAfterManyConsistentImagesWithoutAnotherTag) {
  ExampleRoom room({});
  settle(room);
  room.tags[2].p += kMoved;
  UpdateReport report;
  for (int i = 0; i < 200; ++i) report = room.next_image({}, {2});
  EXPECT_TRUE(report.ambiguous_place);
  for (int i = 0; i < 600; ++i) report = room.next_image({}, {2});
  EXPECT_FALSE(report.ambiguous_place);
}

TEST(MovedTagAlone, IsAcceptedAlthoughOneImageDidNotFit) {
  ExampleRoom room({});
  settle(room);
  room.tags[2].p += kMoved;
  UpdateReport report;
  for (int i = 0; i < 500; ++i) report = room.next_image({}, {2});
  EXPECT_TRUE(report.ambiguous_place);
  room.tags[2].p += kMoved;
  report = room.next_image({}, {2});
  EXPECT_EQ(report.tags_used, 0) << "rejected";
  room.tags[2].p -= kMoved;
  for (int i = 0; i < 300; ++i) report = room.next_image({}, {2});
  EXPECT_FALSE(report.ambiguous_place);
}

}  // namespace
}  // namespace fiducap
