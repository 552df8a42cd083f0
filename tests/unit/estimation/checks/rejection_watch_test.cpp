#include "estimation/checks/size_check.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr int kImagesPerSecond = 20;

class RejectionWatchTest : public testing::Test {
 protected:
  /// @return number of reports within the seconds
  int run(double seconds, int used, int rejected) {
    int said = 0;
    for (int k = 0; k < static_cast<int>(seconds * kImagesPerSecond); ++k, ++image_) {
      UpdateReport report;
      report.exposed_at = instant_from_ns(50'000'000LL * image_);
      report.tags_used = used;
      report.tags_rejected = rejected;
      const auto share = watch_.add(report);
      if (!share) continue;
      ++said;
      share_ = *share;
    }
    return said;
  }

  RejectionWatch watch_;
  long image_{20};
  double share_{0};
};

TEST_F(RejectionWatchTest, ReportsOnceThatHalfOfTheTagsContradictForTenSeconds) {
  EXPECT_EQ(run(9, 2, 2), 0);
  EXPECT_EQ(run(60, 2, 2), 1);
  EXPECT_DOUBLE_EQ(share_, 0.5);
}

TEST_F(RejectionWatchTest, ReportsAgainAfterAnImprovement) {
  EXPECT_EQ(run(20, 2, 2), 1);
  EXPECT_EQ(run(20, 4, 0), 0);
  EXPECT_EQ(run(20, 2, 2), 1);
}

TEST_F(RejectionWatchTest, DoesNotReportOneTagInTen) { EXPECT_EQ(run(60, 9, 1), 0); }

TEST_F(RejectionWatchTest, DoesNotReportAFewBadSeconds) {
  EXPECT_EQ(run(20, 4, 0), 0);
  EXPECT_EQ(run(4, 0, 4), 0);
  EXPECT_EQ(run(20, 4, 0), 0);
}

TEST_F(RejectionWatchTest, ReportsNothingWithoutTags) { EXPECT_EQ(run(60, 0, 0), 0); }

}  // namespace
}  // namespace fiducap
