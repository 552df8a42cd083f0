// The bound against an independent computation (another formulation, other code) on the open
// recordings.
#include <gtest/gtest.h>

#include <cmath>

#include "base/numeric.hpp"
#include "simulation/bound_run.hpp"
#include "support/results.hpp"
#include "support/shared_data.hpp"

namespace fiducap {
namespace {

struct PublishedBound {
  const char* recording;
  char knowledge;
  double position_mm, rotation_deg, velocity_mm_s, camera_mm, map_mm, map_deg, gap_mm;
};

// research/bound.md, table 1; the gap is in the text below it.
const PublishedBound kTable[] = {{"sim_table", 'A', 2.46, 0.071, 2.53, 1.19, 0.185, 0.044, 0},
                                 {"sim_table", 'B', 1.16, 0.058, 2.33, 1.15, 0.185, 0.044, 0},
                                 {"sim_table", 'C', 2.20, 0.042, 2.50, 0.75, 0, 0, 0},
                                 {"sim_table", 'D', 0.68, 0.023, 2.31, 0.68, 0, 0, 0},
                                 {"sim_sparse", 'A', 6.92, 0.144, 5.16, 6.77, 4.96, 0.143, 0},
                                 {"sim_sparse", 'B', 6.68, 0.140, 4.89, 6.62, 4.94, 0.143, 0},
                                 {"sim_sparse", 'C', 3.83, 0.048, 4.92, 3.76, 0, 0, 0},
                                 {"sim_sparse", 'D', 3.57, 0.043, 4.69, 3.57, 0, 0, 0},
                                 {"sim_loop", 'A', 75.8, 0.329, 4.58, 75.5, 52.7, 0.332, 92},
                                 {"sim_loop", 'B', 73.2, 0.322, 4.34, 73.1, 52.6, 0.332, 78},
                                 {"sim_loop", 'C', 3.63, 0.052, 3.74, 2.04, 0, 0, 0},
                                 {"sim_loop", 'D', 2.00, 0.028, 3.56, 2.00, 0, 0, 0},
                                 {"sim_big", 'A', 19.7, 0.186, 2.73, 19.6, 9.76, 0.185, 0},
                                 {"sim_big", 'B', 19.6, 0.186, 2.62, 19.6, 9.76, 0.185, 0},
                                 {"sim_big", 'C', 1.79, 0.016, 2.61, 0.97, 0, 0, 0},
                                 {"sim_big", 'D', 0.95, 0.013, 2.52, 0.95, 0, 0, 0}};

constexpr double kBoundSettled_s = 5.0;
// One per cent, and half a unit of the last digit printed there.
constexpr double kShare = 0.01;

class OpenRecordings : public testing::TestWithParam<PublishedBound> {};

double rms_from(const BoundRun& run, Instant from, double bound::BoundAt::*figure) {
  double sum = 0;
  int count = 0;
  for (const bound::BoundAt& at : run.at) {
    if (at.at < from) continue;
    sum += at.*figure * at.*figure;
    ++count;
  }
  return std::sqrt(sum / count);
}

TEST_P(OpenRecordings, HaveTheIndependentBound) {
  const PublishedBound& expected = GetParam();
  const auto folder = shared_data();
  if (!folder) GTEST_SKIP() << kNoSharedData;
  const auto data = value_of(load_estimation_data((*folder / expected.recording).string()));
  const BoundRun run = run_bound(data, {expected.knowledge});
  const Instant from = time_of(data.samples.front()) + from_seconds(kBoundSettled_s);
  const auto agree = [](double found, double expect, double last_digit, const char* what) {
    EXPECT_NEAR(found, expect, kShare * expect + 0.5 * last_digit) << what;
  };
  const double mm_digit = expected.position_mm > 10 ? 0.1 : 0.01;
  agree(1e3 * rms_from(run, from, &bound::BoundAt::position_m), expected.position_mm, mm_digit,
        "position, mm");
  agree(kDegreesPerRadian * rms_from(run, from, &bound::BoundAt::rotation_rad),
        expected.rotation_deg, 0.001, "orientation, deg");
  agree(1e3 * rms_from(run, from, &bound::BoundAt::velocity_m_s), expected.velocity_mm_s, 0.01,
        "velocity, mm/s");
  agree(1e3 * rms_from(run, from, &bound::BoundAt::camera_m), expected.camera_mm, mm_digit,
        "camera, mm");
  agree(1e3 * run.map.position_m, expected.map_mm, expected.map_mm > 10 ? 0.1 : 0.01, "map, mm");
  agree(kDegreesPerRadian * run.map.rotation_rad, expected.map_deg, 0.001, "map, deg");
  if (expected.gap_mm > 0) {
    ASSERT_TRUE(run.gap.has_value());
    agree(1e3 * run.gap->position_m, expected.gap_mm, 1.0, "loop gap, mm");
  }
}

INSTANTIATE_TEST_SUITE_P(Table1, OpenRecordings, testing::ValuesIn(kTable), [](const auto& one) {
  return std::string(one.param.recording + 4) + one.param.knowledge;
});

}  // namespace
}  // namespace fiducap
