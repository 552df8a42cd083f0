// Wrong configuration costs accuracy in proportion, the sigma covers the error, and the cause is
// reported: through the live path, a few seeds of each. The whole table is
// `fiducap_estimation_bench mismatch` (docs/design/mismatch.md).
#include <gmock/gmock.h>

#include <algorithm>

#include "base/numeric.hpp"
#include "simulation/filter_run.hpp"
#include "simulation/mismatch_changes.hpp"
#include "simulation/mismatch_worlds.hpp"

namespace fiducap {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kScoredAfter_s = 5.0;

const FilterChoice kLive{.filter = "world", .live = true};

struct MismatchOutcome {
  double median_m{};
  double largest_m{};  ///< Of the whole run.
  double nees{};       ///< Of the pose, per degree of freedom.
  int resets{};
  std::vector<std::string> said;
};

MismatchOutcome outcome_of(const std::string& mismatch, const std::string& world,
                           std::uint64_t seed) {
  const EstimationData data =
      mismatched_world({.world = world, .seconds = 30, .seed = seed}, mismatch_named(mismatch));
  FilterRun whole = run_filter(data, kLive);
  MismatchOutcome out;
  out.nees = whole.scored_after(kScoredAfter_s).pose_nees();
  std::erase_if(whole.at, [](const FilterRun::At& at) { return !at.valid; });
  for (const FilterRun::At& at : whole.at)
    out.largest_m = std::max(out.largest_m, at.level_position_m);
  std::vector<double> errors;
  for (const FilterRun::At& at : whole.scored_after(kScoredAfter_s).at)
    errors.push_back(at.level_position_m);
  out.median_m = quantile(std::move(errors), 0.5);
  out.resets = whole.resets;
  out.said = whole.said;
  return out;
}

bool are_equal(const EstimationData& a, const EstimationData& b) {
  const auto same_tag = [](const TagSighting& s, const TagSighting& t) {
    return s.tag_id == t.tag_id && s.corners_px == t.corners_px;
  };
  const auto same_sample = [&](const SensorSample& s, const SensorSample& t) {
    const auto* imu = std::get_if<ImuSample>(&s);
    const auto* other_imu = std::get_if<ImuSample>(&t);
    if (imu != nullptr && other_imu != nullptr)
      return imu->w_WB_B == other_imu->w_WB_B && imu->f_B == other_imu->f_B;
    const auto* image = std::get_if<CornerFrame>(&s);
    const auto* other_image = std::get_if<CornerFrame>(&t);
    return image != nullptr && other_image != nullptr &&
           image->exposed_at == other_image->exposed_at &&
           std::ranges::equal(image->tags, other_image->tags, same_tag);
  };
  return a.camera.model.fu == b.camera.model.fu && a.camera.model.cu == b.camera.model.cu &&
         a.tag_set.sizes_m == b.tag_set.sizes_m &&
         a.nominal_X_BV.q.coeffs() == b.nominal_X_BV.q.coeffs() &&
         std::ranges::equal(a.samples, b.samples, same_sample);
}

TEST(MismatchWorlds, AllRowsButTheFirstDifferFromTheirBase) {
  const SimulatedDataSetup setup{.world = "sparse", .seconds = 20};
  for (const Mismatch& mismatch : mismatches()) {
    const EstimationData base = unmodified_world(setup, mismatch);
    const EstimationData wrong = mismatched_world(setup, mismatch);
    const bool only_map = mismatch.map && !mismatch.data;
    EXPECT_EQ(are_equal(base, wrong), mismatch.name == "nothing" || only_map) << mismatch.name;
    EXPECT_EQ(base.reference_tag, wrong.reference_tag) << mismatch.name;
  }
}

struct MismatchCost {
  const char* mismatch;
  double most_m;        ///< Median; the table class is at 2 mm when nothing is wrong.
  double most_nees;     ///< Mean of two runs.
  const char* reports;  ///< nullptr: nothing.
};

class MismatchedTable : public testing::TestWithParam<MismatchCost> {};

TEST_P(MismatchedTable, IsAccurateConsistentAndReported) {
  const MismatchCost& expected = GetParam();
  double nees = 0;
  for (const std::uint64_t seed : {31u, 32u}) {
    const MismatchOutcome done = outcome_of(expected.mismatch, "table", seed);
    SCOPED_TRACE(seed);
    EXPECT_LT(done.median_m, expected.most_m);
    EXPECT_GT(done.median_m, 0);
    EXPECT_EQ(done.resets, 0);
    if (expected.reports != nullptr) {
      EXPECT_THAT(done.said, Contains(HasSubstr(expected.reports)));
    } else {
      EXPECT_THAT(done.said, IsEmpty());
    }
    nees += done.nees / 2;
  }
  EXPECT_LT(nees, expected.most_nees);
}

// Without checks of the configuration: tag sizes 9 mm and NEES 15, misread reference 590 mm, IMU
// NEES 15, and no report. An IMU noisier than configured is detected after some seconds, and the
// start is processed again with the learned noise.
INSTANTIATE_TEST_SUITE_P(
    ElevenWorlds, MismatchedTable,
    testing::Values(MismatchCost{"nothing", 0.005, 2.0, nullptr},
                    MismatchCost{"prints 2 %", 0.005, 3.0, "all tags seem"},
                    MismatchCost{"focal 1 %", 0.005, 3.0, "the lens seems"},
                    MismatchCost{"barrel", 0.005, 2.5, "distortion k1 seems"},
                    MismatchCost{"readout 15 ms", 0.005, 2.5, "rolling shutter"},
                    MismatchCost{"stamps 3 ms", 0.005, 2.5, "stamps seem to jitter"},
                    MismatchCost{"IMU x5", 0.016, 3.0, "times as noisy"},
                    MismatchCost{"jump 0.2 s", 0.005, 2.5, "has jumped by 0.20 s"},
                    MismatchCost{"jump -0.2 s", 0.005, 2.5, "has jumped by 0.2"},
                    MismatchCost{"misread reference", 0.005, 2.5, nullptr},
                    MismatchCost{"gravity 9.78", 0.005, 2.0, nullptr}),
    [](const auto& one) {
      std::string name = one.param.mismatch;
      if (const auto minus = name.find('-'); minus != std::string::npos)
        name.replace(minus, 1, "minus");
      std::erase_if(name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
      return name;
    });

TEST(MismatchedSparse, BridgesAJumpOfStampsWithTheImu) {
  const MismatchOutcome done = outcome_of("jump 0.2 s", "sparse", 31);
  EXPECT_LT(done.median_m, 0.01);
  EXPECT_LT(done.nees, 2.5);
  EXPECT_EQ(done.resets, 0);
  EXPECT_THAT(done.said, Contains(HasSubstr("has jumped by 0.2")));
}

// Neither configured nor estimated: 13.7 mm instead of 2.3, NEES 25, and tag sizes reported.
TEST(MismatchedGravity, CostsNothingAndReportsNoPrint) {
  constexpr double kAsGood = 1.2;
  for (const char* world : {"table", "sparse"}) {
    const MismatchOutcome usual = outcome_of("nothing", world, 33);
    for (const char* gravity : {"gravity 9.78 configured", "gravity 9.78"}) {
      const MismatchOutcome done = outcome_of(gravity, world, 33);
      SCOPED_TRACE(std::string(world) + ", " + gravity);
      EXPECT_LT(done.median_m, kAsGood * usual.median_m);
      EXPECT_LT(done.nees, 2.0);
      EXPECT_THAT(done.said, IsEmpty());
    }
  }
}

TEST(MismatchedAxes, GiveNoPoseElsewhere) {
  for (const char* mismatch : {"camera turned 90 deg", "gyro axes swapped"})
    EXPECT_LT(outcome_of(mismatch, "table", 31).largest_m, 0.5) << mismatch;
}

/// A single camera, a table, and a lens that is 8 % longer than configured.
FilterRun guessed_lens(double focal_sigma, bool refines) {
  EstimationData data = simulate({.world = "table", .seconds = 25, .seed = 41, .has_imu = false});
  mismatch::lengthen_configured_lens(data, 1 / 1.08);
  data.camera.focal_sigma = focal_sigma;
  FilterChoice choice = kLive;
  choice.estimator.refine_intrinsics = refines;
  return run_filter(data, choice).scored_after(kScoredAfter_s);
}

void expect_refined(const FilterRun& run) {
  EXPECT_LT(run.position_rmse_m(), 0.03) << "65 mm with the configured lens";
  EXPECT_LT(run.pose_nees(), 2.5);
  EXPECT_THAT(run.said, Contains(HasSubstr("the lens is refined")));
}

TEST(GuessedLens, IsRefinedWithAConfiguredSigma) { expect_refined(guessed_lens(0.1, false)); }

TEST(GuessedLens, IsRefinedWhenLensesAreRefined) { expect_refined(guessed_lens(0, true)); }

/// A lens with two distortion coefficients, configured with none and with sigmas: only the first is
/// estimated.
TEST(GuessedLens, StaysUncertainAboutUnmodelledDistortion) {
  EstimationData data = simulate({.world = "table", .seconds = 25, .seed = 41});
  mismatch::bend_images(data, -0.12, 0.04);
  data.camera.focal_sigma = data.camera.k1_sigma = 0.1;
  data.camera.centre_sigma_px = 20;
  const FilterRun run = run_filter(data, kLive).scored_after(kScoredAfter_s);
  EXPECT_LT(run.position_rmse_m(), 0.006);
  EXPECT_LT(run.pose_nees(), 2.5);
  EXPECT_THAT(run.said, Contains(HasSubstr("k1 -0.1")));
}

/// Rendered images of a lens that is 8 % shorter than configured as exact.
double rmse_with_wrong_lens(std::uint64_t seed) {
  EstimationData data =
      simulate({.world = "table", .seconds = 25, .seed = seed, .images_for = "world"});
  mismatch::lengthen_configured_lens(data, 1.08);
  return run_filter(data, kLive).scored_after(10).position_rmse_m();
}

/// 4 to 6 mm; 4 to 70 when images are gated with sharp corners before the lens is estimated, 5 to
/// 28 when a start that is processed again begins with the configured lens.
TEST(WrongLens, IsRefinedEarlyAndPermanently) {
  for (std::uint64_t seed = 41; seed <= 45; ++seed)
    EXPECT_LT(rmse_with_wrong_lens(seed), 0.012) << "seed " << seed;
}

TEST(MismatchedSparse, FindsSwappedPrintsAgainWithoutAReset) {
  const MismatchOutcome done = outcome_of("two prints swapped", "sparse", 31);
  EXPECT_LT(done.median_m, 0.03);
  EXPECT_EQ(done.resets, 0);
}

struct LensOutcome {
  double map_nees{};
  double pose_nees{};
  int contradicted{};  ///< Tags removed from the map, or reported as moved.
  std::size_t said{};
};

/// A walk through the hall with a lens that is 0.05 px off, as a good calibration leaves it.
LensOutcome with_lens_error(double configured_px) {
  constexpr int kSeeds = 4;
  LensOutcome out;
  for (std::uint64_t seed = 401; seed < 401 + kSeeds; ++seed) {
    const std::vector<EstimationData> data{
        with_calibrated_lens({.world = "hall", .seconds = 60, .seed = seed}, 0.05, configured_px)};
    const TogetherRun run = run_together(data, kLive);
    out.map_nees += run.map_nees / kSeeds;
    out.pose_nees += run.bodies.front().pose_nees() / kSeeds;
    for (const MapEvent& event : run.map_events) {
      out.contradicted += event.kind == MapEvent::Kind::kTagQuarantined ||
                          event.kind == MapEvent::Kind::kTagDisputed;
    }
    out.said += run.bodies.front().said.size();
  }
  return out;
}

TEST(CalibratedLens, WithConfiguredErrorContradictsNoTag) {
  const LensOutcome configured = with_lens_error(0.05);
  EXPECT_EQ(configured.contradicted, 0);
  EXPECT_EQ(configured.said, 0u);
  EXPECT_LT(configured.map_nees, 2.0);
  EXPECT_LT(configured.pose_nees, 1.6);
  // Assumed exact, the same lens makes the map overconfident and wrong by millimetres.
  EXPECT_GT(with_lens_error(0).map_nees, 3.0);
}

}  // namespace
}  // namespace fiducap
