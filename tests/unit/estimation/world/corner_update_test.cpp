// A body that returns from a drift of decimetres to tags with sharp corners.
#include "estimation/filter/corner_update.hpp"

#include <gtest/gtest.h>

#include <random>

#include "estimation/world/corner_measurement.hpp"
#include "example_tags.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::world {
namespace {

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
    CornerUpdate<FilterState> update;
    update.apply(after, 0, model_, tags, {.gate = kNoGate, .iterations = iterations}, noise,
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
