#include "scene/scene_frame.hpp"

#include <gtest/gtest.h>

#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

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

TEST(TagFits, ForgetOldSightings) {
  TagFits fits;
  fits.add(image(0, {{7, 100.0}}));
  for (int i = 1; i < 1000; ++i) fits.add(image(i, {{7, 0.3}}));
  EXPECT_NEAR(fits.list()[0].rms_px, 0.3, 1e-3);
}

TEST(TagFits, IgnoreAStartThatMayBeRevoked) {
  TagFits fits;
  auto open = image(0, {{7, 1.0}});
  open.start_is_open = true;
  fits.add(open);
  fits.add(image(0, {{8, std::numeric_limits<double>::quiet_NaN()}}));
  EXPECT_TRUE(fits.list().empty());
}

TEST(TagFits, AreBounded) {
  TagFits fits;
  for (int id = 0; id < 2 * static_cast<int>(TagFits::kMostTags); ++id)
    fits.add(image(0, {{id, 1.0}}));
  EXPECT_EQ(fits.list().size(), TagFits::kMostTags);
}

TEST(TagFits, AllocateNothingPerImage) {
  TagFits fits;
  const auto report = image(0, {{7, 1.0}, {8, 1.0}});
  fits.add(report);
  const AllocationCounter counter;
  for (int i = 0; i < 10; ++i) fits.add(report);
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap
