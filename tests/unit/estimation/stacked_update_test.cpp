#include "estimation/filter/stacked_update.hpp"

#include <gtest/gtest.h>

#include <array>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <random>

#include "estimation/filter/chi_square.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/image_update.hpp"
#include "example_tags.hpp"
#include "support/jacobian_check.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {
namespace {

// Two ways through the same algebra, relative to the largest number: double precision times the
// condition number, which sides of 0.02 to 1.5 px alone make 5600 (1.2e-12), and the state more.
constexpr double kSame = 1e-11;
constexpr double kNoise_px = 0.4;

struct Outcome {
  double nis{};
  int degrees_of_freedom{};
  double rms_px{};
  std::vector<StackedUpdate::Judged> judged;
  std::vector<bool> accepted;
  Eigen::VectorXd correction;
  Eigen::MatrixXd P;
};

Outcome update(const FilterState& state, ImageMeasurement image, std::span<const int> held) {
  Outcome out;
  out.P = state.P();
  StackedUpdate update;
  update.prepare(out.P, image);
  update.gate(out.P, image, {chi_square_quantile(8, 0.999), chi_square_quantile(6, 0.9)},
              out.accepted);
  out.judged.assign(update.judged().begin(), update.judged().end());
  out.nis = update.solve(out.P, image, held);
  out.degrees_of_freedom = update.degrees_of_freedom();
  out.rms_px = update.rms_px(image);
  out.correction = update.correction();
  update.shrink(out.P, held);
  return out;
}

/// Camera 0, a global shutter, sees the three tags of the example, a calibrated one, and an
/// outlier.
class TurnedTag : public testing::TestWithParam<double> {
 protected:
  TurnedTag() : state_(example_state()) {
    state_.P() *= 1e-4;
    // Eight numbers have a little more information about doubted parameters.
    state_.parameter_tests.clear();
    state_.clear_column(layout::readout(0), 0);
    state_.clocks[0].shift_s += GetParam();
    given_ = {13, 0.2, state_.tags[0].X_WT, Matrix6d::Zero()};
    for (std::size_t i = 0; i < seen_.size(); ++i) {
      const Pose& X_WT = state_.tags[i % 3].X_WT;
      seen_[i] = example_observation(10 + static_cast<int>(i), 0.2, state_.X_WV(0).inverse() * X_WT,
                                     example_camera());
      const double way = 0.1 * static_cast<double>(i);
      for (Eigen::Vector2d& corner : seen_[i].corners_px)
        corner += Eigen::Vector2d(0.4 - 7 * way * way, way - 0.3);
      seen_[i].corners_px[i % 4] += Eigen::Vector2d(-0.5, 0.6);
      use_[i] = {&seen_[i], static_cast<int>(i), nullptr};
    }
    use_[3] = {&seen_[3], -1, &given_};
    use_[4] = {&seen_[4], 1, nullptr};
    for (Eigen::Vector2d& corner : seen_[4].corners_px) corner.x() += 60;
  }

  [[nodiscard]] CornerNoise noise() const {
    EstimatorConfig config;
    config.corner_noise_px = kNoise_px;
    return CornerNoise(config, uneven_);
  }

  [[nodiscard]] ImageMeasurement turned() const {
    ImageMeasurement image;
    measure_image(state_, 0, example_camera(), use_, noise(), image);
    return image;
  }

  [[nodiscard]] ImageMeasurement whole() const {
    ImageMeasurement image;
    for (const TagToUse& tag : use_)
      image.tags.push_back(measure(state_, 0, example_camera(), tag, noise()));
    return image;
  }

  /// Some tags with sides that are differently well known, two as before.
  void smear() {
    uneven_ = true;
    for (const std::size_t i : {0, 2, 3, 4})
      seen_[i].sides = {{{0.05, 0.1}, {1.5, 0.4}, {0.02, 0.3}, {1.2, 0.9}}};
    seen_[1].corner_sigma_px = 0.3;
  }

  void expect_same(const Outcome& a, const Outcome& b) {
    EXPECT_NEAR(a.nis, b.nis, kSame * b.nis);
    EXPECT_EQ(a.degrees_of_freedom, b.degrees_of_freedom);
    EXPECT_NEAR(a.rms_px, b.rms_px, kSame * b.rms_px);
    EXPECT_EQ(a.accepted, b.accepted);
    ASSERT_EQ(a.judged.size(), b.judged.size());
    for (std::size_t i = 0; i < a.judged.size(); ++i) {
      EXPECT_NEAR(a.judged[i].distance, b.judged[i].distance, kSame * b.judged[i].distance);
      // Uneven ones are weighted by their own noise.
      if (!uneven_) {
        EXPECT_NEAR(a.judged[i].noise_share, b.judged[i].noise_share, kSame);
      }
    }
    EXPECT_LT((a.correction - b.correction).norm(), kSame * b.correction.norm());
    EXPECT_LT((a.P - b.P).cwiseAbs().maxCoeff(), kSame * state_.P().cwiseAbs().maxCoeff());
    EXPECT_EQ(a.P, a.P.transpose());
  }

  bool uneven_{false};
  FilterState state_;
  KnownTag given_;
  std::array<TagObservation, 5> seen_;
  std::array<TagToUse, 5> use_;
};

TEST_P(TurnedTag, SixNumbersMatchEight) {
  const ImageMeasurement image = turned();
  for (const TagMeasurement& m : image.tags) ASSERT_TRUE(m.relative);
  const Outcome six = update(state_, image, {});
  EXPECT_EQ(six.accepted, (std::vector<bool>{true, true, true, true, false}));
  EXPECT_GT((six.P - state_.P()).norm(), 0.01 * state_.P().norm()) << "it learned something";
  expect_same(six, update(state_, whole(), {}));
}

TEST_P(TurnedTag, AnOutlyingCornerIsNotUsed) {
  state_.clocks[0].shift_s -= GetParam();
  state_.P() *= 1e-4;  // corners are predicted
  seen_[4].corners_px = seen_[1].corners_px;
  const Outcome good = update(state_, turned(), {});
  seen_[2].corners_px[1] += Eigen::Vector2d(0, 40);
  const Outcome six = update(state_, turned(), {});
  EXPECT_TRUE(six.accepted[2]);
  EXPECT_EQ(six.judged[2].outlier, 1);
  EXPECT_EQ(six.degrees_of_freedom, good.degrees_of_freedom - 2);
  EXPECT_LT((six.correction - good.correction).norm(), 0.5 * good.correction.norm());
  expect_same(six, update(state_, whole(), {}));
}

TEST_P(TurnedTag, MatchesWithUnevenNoise) {
  const Outcome even = update(state_, turned(), {});
  smear();
  const ImageMeasurement image = turned();
  EXPECT_TRUE(!image.tags[0].even && image.tags[1].even);
  const Outcome six = update(state_, image, {});
  EXPECT_GT((six.correction - even.correction).norm(), 0.1 * even.correction.norm());
  expect_same(six, update(state_, whole(), {}));
}

TEST_P(TurnedTag, MatchesForKnownTagsWithNoise) {
  smear();
  ImageMeasurement image = turned();
  StackedUpdate update;
  update.prepare(state_.P(), image);
  constexpr double kAnything = 1e9;
  std::vector<bool> accepted;
  update.gate(state_.P(), image, {kAnything, kAnything}, accepted);
  (void)update.solve(state_.P(), image, {});
  Matrix6d information = Matrix6d::Zero();
  for (std::size_t i = 0; i < use_.size(); ++i) {
    information += propagated(image.tags[i].H.transpose(), inverse(whole().tags[i].R));
  }
  const Matrix6d got = update.shared_score(image).by_known_tags;
  EXPECT_LT((got - information).norm(), kSame * information.norm());
}

TEST_P(TurnedTag, MatchesForHeldTags) {
  const std::array<int, 2> held{state_.tag_at(0), state_.tag_at(2)};
  const Outcome six = update(state_, turned(), held);
  for (const int a : held) {
    EXPECT_TRUE(six.correction.segment<6>(a).isZero(0));
    for (const int b : held) EXPECT_EQ((six.P.block<6, 6>(a, b)), (state_.P().block<6, 6>(a, b)));
  }
  expect_same(six, update(state_, whole(), held));
}

TEST_P(TurnedTag, IsMovedToAnotherLinearisationPointEqually) {
  const Eigen::VectorXd error = Eigen::VectorXd::LinSpaced(state_.size(), -1e-3, 2e-3);
  ImageMeasurement six = turned();
  ImageMeasurement eight = whole();
  six.take_off(error);
  eight.take_off(error);
  for (std::size_t i = 0; i < six.tags.size(); ++i) {
    EXPECT_LT((six.tags[i].y - eight.tags[i].y).norm(), kSame * eight.tags[i].y.norm());
    EXPECT_GT((six.tags[i].y - turned().tags[i].y).norm(), 1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(AtAndBesideTheStatesInstant, TurnedTag, testing::Values(0.0, 0.004));

TEST(RollingShutter, KeepsEightNumbersPerTag) {
  FilterState state = example_state();
  state.clocks[0].rows_apart = true;
  const TagObservation seen =
      example_observation(10, 0.2, state.X_WV(0).inverse() * state.tags[0].X_WT, example_camera());
  const std::array<TagToUse, 1> use{TagToUse{&seen, 0, nullptr}};
  ImageMeasurement image;
  measure_image(state, 0, example_camera(), use, CornerNoise(EstimatorConfig{}, false), image);
  EXPECT_FALSE(image.tags[0].relative) << "its readout time is not certain";
  measure_image(state, 1, example_camera(), use, CornerNoise(EstimatorConfig{}, false), image);
  EXPECT_FALSE(image.tags[0].relative) << "its rows are exposed in turn";
}

// Sums of squares as normal variables, against the exact distribution.
// The approximation itself is 0.13 short at 4 sigma of a sum of two, and better of all others.
TEST(NormalScore, HasTheProbabilityOfTheSumOfSquares) {
  for (const int degrees : {2, 4, 10, 100}) {
    for (const double sigmas : {-1.0, 0.0, 1.0, 2.0, 3.0, 4.0}) {
      const double probability = boost::math::cdf(boost::math::normal(), sigmas);
      const double value = chi_square_quantile(degrees, probability);
      EXPECT_NEAR(
          normal_score((value - degrees) / std::sqrt(2.0 * degrees), std::sqrt(8.0 / degrees)),
          sigmas, 0.13)
          << degrees << " degrees of freedom";
    }
  }
  EXPECT_EQ(normal_score(3.0, 0.0), 3.0);
  EXPECT_NEAR(normal_score(3.0, 2e-3), 3.0, 1e-2);
}

constexpr double kCorner_px = 0.07;
constexpr double kNoGate = 1e9;
constexpr int kDraws = 100;

/// One camera, rigid on its body, before two tags whose places are known.
FilterState before_two_tags(double position_sigma_m, double rotation_sigma_rad) {
  FilterState state;
  state.reset({{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}}});
  state.X_WB = {exp_so3({0.4, -0.6, 1.1}), {0.2, -0.3, 0.1}};
  for (int i = 0; i < 2; ++i) {
    WorldTag tag;
    tag.tag_id = 10 + i;
    tag.edge_m = 0.2;
    tag.X_WT = state.X_WV(0) * Pose{exp_so3({3.0, 0.5 - 0.8 * i, 0.4}), {-0.3 + 0.6 * i, 0.1, 1.5}};
    state.add_tag(tag, Matrix6d::Zero());
  }
  // Rigid: body and camera move together in W.
  Vector6d sigmas;
  sigmas << Eigen::Vector3d::Constant(position_sigma_m),
      Eigen::Vector3d::Constant(rotation_sigma_rad);
  const Matrix6d own = sigmas.cwiseAbs2().asDiagonal();
  const int body = layout::kPosition;
  const int camera = layout::camera(0);
  for (const int row : {body, camera}) {
    for (const int column : {body, camera}) state.P().block<6, 6>(row, column) = own;
  }
  return state;
}

/// An image from the true body pose, which is drawn from the covariance of the state.
class Return {
 public:
  Return(const FilterState& state, unsigned seed) : truth_(state) {
    std::mt19937 random(seed);
    std::normal_distribution<double> gauss;
    Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
    for (int i = 0; i < 6; ++i) {
      const int at = layout::kPosition + i;
      error(at) = gauss(random) * std::sqrt(state.P()(at, at));
    }
    error.segment<6>(layout::camera(0)) = error.segment<6>(layout::kPosition);
    truth_.add_error(error);
    for (const WorldTag& tag : truth_.tags) {
      const Pose X_VT = truth_.X_WV(0).inverse() * tag.X_WT;
      seen_.push_back(example_observation(tag.tag_id, tag.edge_m, X_VT, model_));
      TagObservation& seen = seen_.back();
      seen.ideal_from_raw.fill(Eigen::Matrix2d::Identity());
      for (auto& px : seen.corners_px)
        px += kCorner_px * Eigen::Vector2d(gauss(random), gauss(random));
    }
  }

  FilterState update(const FilterState& before, int iterations) {
    EstimatorConfig config;
    config.corner_noise_px = kCorner_px;
    CornerNoise noise(config, false);
    std::vector<TagToUse> tags;
    for (std::size_t i = 0; i < seen_.size(); ++i)
      tags.push_back({&seen_[i], static_cast<int>(i), nullptr});
    std::vector<bool> accepted;
    FilterState after = before;
    CornerUpdate update;
    update.apply(after, 0, model_, tags, {.gate = {kNoGate, 0}, .iterations = iterations}, noise,
                 accepted);
    return after;
  }

  /// Of the camera's pose, per degree of freedom.
  [[nodiscard]] double nees(const FilterState& after) const {
    const int camera = layout::camera(0);
    const Vector6d off = after.error_to(truth_).segment<6>(camera);
    return squared_distance(off, after.P().block<6, 6>(camera, camera)) / 6;
  }

 private:
  CameraModel model_ = example_camera();
  FilterState truth_;
  std::vector<TagObservation> seen_;
};

double mean_nees(int iterations) {
  const FilterState before = before_two_tags(0.1, 0.03);
  double sum = 0;
  for (unsigned seed = 0; seed < kDraws; ++seed) {
    Return back(before, seed);
    sum += back.nees(back.update(before, iterations));
  }
  return sum / kDraws;
}

TEST(CornerUpdate, IsConsistentAfterALargeDrift) {
  EXPECT_NEAR(mean_nees(5), 1.0, 0.2);  // 3.5 sigma of the mean of 600 squares
  EXPECT_GT(mean_nees(1), 3.0);         // from a single line
}

}  // namespace
}  // namespace fiducap::world
