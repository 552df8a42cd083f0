// Wrong configuration costs accuracy in proportion, the sigma covers the error, and the cause is
// reported: through the live path, a few seeds of each. The whole table is
// `fiducap_estimation_bench mismatch` (docs/design/mismatch.md).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "simulation/filter_run.hpp"
#include "simulation/mismatch_changes.hpp"
#include "simulation/mismatch_worlds.hpp"
#include "simulation/told_lens.hpp"

namespace fiducap {
namespace {

constexpr double kScoredAfter_s = 5.0;

const Mismatch& mismatch_named(const std::string& name) {
  const auto found = std::find_if(mismatches().begin(), mismatches().end(),
                                  [&](const Mismatch& m) { return m.name == name; });
  if (found == mismatches().end()) throw std::runtime_error("no mismatch " + name);
  return *found;
}

struct Outcome {
  double median_m{};
  double largest_m{};  ///< Of the whole run.
  double nees{};       ///< Of the pose, per degree of freedom.
  int resets{};
  std::vector<std::string> said;
};

Outcome outcome_of(const std::string& mismatch, const std::string& world, std::uint64_t seed) {
  const EstimationData data =
      mismatched_world({.world = world, .seconds = 30, .seed = seed}, mismatch_named(mismatch));
  FilterChoice choice;
  choice.filter = "world";
  choice.live = true;
  const FilterRun whole = run_filter(data, choice);
  const FilterRun scored = whole.scored_after(kScoredAfter_s);
  std::vector<double> errors;
  Outcome out;
  for (const FilterRun::At& at : scored.at) {
    if (!at.valid) continue;
    errors.push_back(at.level_position_m);
  }
  for (const FilterRun::At& at : whole.at)
    if (at.valid) out.largest_m = std::max(out.largest_m, at.level_position_m);
  if (!errors.empty()) {
    std::nth_element(errors.begin(),
                     errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
    out.median_m = errors[errors.size() / 2];
  }
  out.nees = scored.mean([](const FilterRun::At& at) { return at.nees.pose; }) / 6;
  out.resets = whole.resets;
  out.said = whole.said;
  return out;
}

struct Expected {
  const char* mismatch;
  double most_m;     ///< Median; the table class is at 2 mm when nothing is wrong.
  double most_nees;  ///< Mean of two runs.
  const char* says;  ///< nullptr: nothing.
};

class MismatchedTable : public testing::TestWithParam<Expected> {};

TEST_P(MismatchedTable, CostsLittleIsCoveredAndNamed) {
  const Expected& expected = GetParam();
  double nees = 0;
  for (const std::uint64_t seed : {31u, 32u}) {
    const Outcome done = outcome_of(expected.mismatch, "table", seed);
    EXPECT_LT(done.median_m, expected.most_m) << "seed " << seed;
    EXPECT_GT(done.median_m, 0) << "seed " << seed;
    EXPECT_EQ(done.resets, 0) << "seed " << seed;
    if (expected.says != nullptr) {
      EXPECT_THAT(done.said, testing::Contains(testing::HasSubstr(expected.says)))
          << "seed " << seed;
    } else {
      EXPECT_THAT(done.said, testing::IsEmpty()) << "seed " << seed;
    }
    nees += done.nees / 2;
  }
  EXPECT_LT(nees, expected.most_nees);
}

// Without these tests: tag sizes 9 mm and NEES 15, misread reference 590 mm, IMU NEES 15, and no
// report. An IMU noisier than configured is detected after some seconds, and the start is processed
// again with the learned noise.
INSTANTIATE_TEST_SUITE_P(
    ElevenWorlds, MismatchedTable,
    testing::Values(Expected{"nothing", 0.005, 2.0, nullptr},
                    Expected{"prints 2 %", 0.005, 3.0, "all tags seem"},
                    Expected{"focal 1 %", 0.005, 3.0, "the lens seems"},
                    Expected{"barrel", 0.005, 2.5, "distortion k1 seems"},
                    Expected{"readout 15 ms", 0.005, 2.5, "rolling shutter"},
                    Expected{"stamps 3 ms", 0.005, 2.5, "stamps seem to jitter"},
                    Expected{"IMU x5", 0.016, 3.0, "times as noisy"},
                    Expected{"jump 0.2 s", 0.005, 2.5, "has jumped by 0.20 s"},
                    Expected{"jump -0.2 s", 0.005, 2.5, "has jumped by 0.2"},
                    Expected{"misread reference", 0.005, 2.5, nullptr},
                    Expected{"gravity 9.78", 0.005, 2.0, nullptr}),
    [](const auto& one) {
      std::string name = one.param.mismatch;
      if (const auto minus = name.find('-'); minus != std::string::npos)
        name.replace(minus, 1, "minus");
      std::erase_if(name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
      return name;
    });

TEST(MismatchedSparse, AJumpIsBridgedWithWhatTheImuKnows) {
  const Outcome done = outcome_of("jump 0.2 s", "sparse", 31);
  EXPECT_LT(done.median_m, 0.01);
  EXPECT_LT(done.nees, 2.5);
  EXPECT_EQ(done.resets, 0);
  EXPECT_THAT(done.said, testing::Contains(testing::HasSubstr("has jumped by 0.2")));
}

// Neither configured nor estimated: 13.7 mm where 2.3 were possible, NEES 25, and tag sizes
// reported.
TEST(MismatchedGravity, CostsNothingOnceItIsToldAndBlamesNoPrint) {
  constexpr double kAsGood = 1.2;
  for (const char* world : {"table", "sparse"}) {
    const Outcome usual = outcome_of("nothing", world, 33);
    for (const char* gravity : {"gravity 9.78 told", "gravity 9.78"}) {
      const Outcome done = outcome_of(gravity, world, 33);
      EXPECT_LT(done.median_m, kAsGood * usual.median_m) << world << ", " << gravity;
      EXPECT_LT(done.nees, 2.0) << world << ", " << gravity;
      EXPECT_THAT(done.said, testing::IsEmpty()) << world << ", " << gravity;
    }
  }
}

TEST(MismatchedAxes, NeverGiveAPoseThatIsElsewhere) {
  for (const char* mismatch : {"camera turned 90 deg", "gyro axes swapped"})
    EXPECT_LT(outcome_of(mismatch, "table", 31).largest_m, 0.5) << mismatch;
}

/// A single camera, a table, and a lens that is 8 % longer than configured.
FilterRun guessed_lens(double focal_sigma, bool refines) {
  EstimationData data = simulate({.world = "table", .seconds = 25, .seed = 41, .has_imu = false});
  mismatch::lengthen_told_lens(data, 1 / 1.08);
  data.camera.focal_sigma = focal_sigma;
  FilterChoice choice;
  choice.filter = "world";
  choice.live = true;
  choice.estimator.refine_intrinsics = refines;
  return run_filter(data, choice).scored_after(kScoredAfter_s);
}

void expect_refined(const FilterRun& run) {
  EXPECT_LT(run.position_rmse_m(), 0.03) << "believed, it is at 65 mm";
  EXPECT_LT(run.mean([](const FilterRun::At& at) { return at.nees.pose; }) / 6, 2.5);
  EXPECT_THAT(run.said, testing::Contains(testing::HasSubstr("the lens is refined")));
}

TEST(GuessedLens, IsLearnedWhenItsSigmaIsTold) { expect_refined(guessed_lens(0.1, false)); }

TEST(GuessedLens, IsLearnedWhenLensesAreRefined) { expect_refined(guessed_lens(0, true)); }

/// A lens configured without distortion, with sigmas, that has two coefficients: only the first is
/// learned.
TEST(GuessedLens, HasMoreDistortionThanIsLearnedWithoutBeingSureOfIt) {
  EstimationData data = simulate({.world = "table", .seconds = 25, .seed = 41});
  mismatch::bend_images(data, -0.12, 0.04);
  data.camera.focal_sigma = data.camera.k1_sigma = 0.1;
  data.camera.centre_sigma_px = 20;
  FilterChoice choice;
  choice.filter = "world";
  choice.live = true;
  const FilterRun run = run_filter(data, choice).scored_after(kScoredAfter_s);
  EXPECT_LT(run.position_rmse_m(), 0.006);
  EXPECT_LT(run.mean([](const FilterRun::At& at) { return at.nees.pose; }) / 6, 2.5);
  EXPECT_THAT(run.said, testing::Contains(testing::HasSubstr("k1 -0.1")));
}

/// Rendered images of a lens that is 8 % shorter than configured as exact.
double rmse_behind_a_wrong_lens(std::uint64_t seed) {
  EstimationData data =
      simulate({.world = "table", .seconds = 25, .seed = seed, .images_for = "world"});
  mismatch::lengthen_told_lens(data, 1.08);
  FilterChoice choice;
  choice.filter = "world";
  choice.live = true;
  return run_filter(data, choice).scored_after(10).position_rmse_m();
}

/// 4 to 6 mm; 4 to 70 when images are gated with sharp corners before the lens is opened, 5 to 28
/// when a start that is processed again begins with the configured lens.
TEST(ToldLens, IsDoubtedSoonAndForGood) {
  for (std::uint64_t seed = 41; seed <= 45; ++seed)
    EXPECT_LT(rmse_behind_a_wrong_lens(seed), 0.012) << "seed " << seed;
}

TEST(MismatchedSparse, SwappedPrintsAreGivenUpAndFoundAgainWithoutAReset) {
  const Outcome done = outcome_of("two prints swapped", "sparse", 31);
  EXPECT_LT(done.median_m, 0.03);
  EXPECT_EQ(done.resets, 0);
}

struct BehindALens {
  double map_nees{};
  double pose_nees{};
  int wronged{};  ///< Tags removed from the map, or reported as moved.
  std::size_t said{};
};

/// A walk through the hall with a lens that is 0.05 px off, as a good calibration leaves it.
BehindALens behind_a_calibrated_lens(double told_px) {
  constexpr int kSeeds = 4;
  BehindALens out;
  for (std::uint64_t seed = 401; seed < 401 + kSeeds; ++seed) {
    const std::vector<EstimationData> data{
        behind_a_told_lens({.world = "hall", .seconds = 60, .seed = seed}, 0.05, told_px)};
    FilterChoice choice;
    choice.filter = "world";
    choice.live = true;
    choice.refine_period_s = 0;
    const TogetherRun run = run_together(data, choice);
    out.map_nees += run.map_nees / kSeeds;
    out.pose_nees +=
        run.bodies.front().mean([](const auto& at) { return at.nees.pose; }) / (6.0 * kSeeds);
    for (const MapEvent& event : run.map_events) {
      using Kind = MapEvent::Kind;
      out.wronged += event.kind == Kind::kTagQuarantined || event.kind == Kind::kTagDisputed;
    }
    out.said += run.bodies.front().said.size();
  }
  return out;
}

TEST(CalibratedLens, ThatTellsWhatItLeavesContradictsNoTag) {
  const BehindALens told = behind_a_calibrated_lens(0.05);
  EXPECT_EQ(told.wronged, 0);
  EXPECT_EQ(told.said, 0u);
  EXPECT_LT(told.map_nees, 2.0);
  EXPECT_LT(told.pose_nees, 1.6);
  // Taken for exact, the same lens makes the map millimetres wrong and sure of less.
  EXPECT_GT(behind_a_calibrated_lens(0).map_nees, 3.0);
}

}  // namespace
}  // namespace fiducap
