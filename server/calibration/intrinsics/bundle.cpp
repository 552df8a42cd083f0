#include "calibration/intrinsics/bundle.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <ceres/rotation.h>

#include "calibration/intrinsics/lens_model.hpp"

namespace fiducap {
namespace {

/// A pose as Ceres keeps it: q (x y z w), then p.
using Block = std::array<double, 7>;
using PoseManifold =
    ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>;

Block to_block(const Pose& X) {
  return {X.q.x(), X.q.y(), X.q.z(), X.q.w(), X.p.x(), X.p.y(), X.p.z()};
}

Pose to_pose(const Block& b) {
  return {Eigen::Quaterniond(b[3], b[0], b[1], b[2]).normalized(), {b[4], b[5], b[6]}};
}

template <typename T>
Eigen::Matrix<T, 3, 1> carry(const T* pose, const Eigen::Matrix<T, 3, 1>& p) {
  const Eigen::Map<const Eigen::Quaternion<T>> q(pose);
  const Eigen::Map<const Eigen::Matrix<T, 3, 1>> origin(pose + 4);
  return q * p + origin;
}

struct PointCost {
  Distortion kind;
  Eigen::Vector3d p_TP;
  Eigen::Vector2d seen_px;
  double lost_px;  ///< Constant residual of a point behind the camera.

  template <typename T>
  bool operator()(const T* lens, const T* X_VG, const T* X_GT, T* residual) const {
    const Eigen::Matrix<T, 3, 1> p_VP = carry<T>(X_VG, carry<T>(X_GT, p_TP.cast<T>()));
    if (kind != Distortion::kEquidistant && !(p_VP.z() > T(1e-6))) {
      residual[0] = residual[1] = T(lost_px);
      return true;
    }
    T px[2];
    project_through(kind, lens, p_VP.data(), px);
    residual[0] = seen_px.x() - px[0];
    residual[1] = seen_px.y() - px[1];
    return true;
  }
};

PointCost cost_of(const CalibrationData& data, const CameraModel& camera,
                  const TargetSighting& sighting, const SeenPoint& seen) {
  return {camera.distortion, data.target_of(sighting).points[to_index(seen.point)], seen.px,
          static_cast<double>(data.width)};
}

/// The state as blocks of numbers, and the Ceres problem over them.
class Bundle final {
 public:
  Bundle(const CalibrationData& data, const BundleOptions& options, const CalibrationState& state)
      : lens_(numbers_of(state.camera)) {
    for (const Pose& X_GT : state.X_GT) targets_.push_back(to_block(X_GT));
    for (const auto& poses : state.X_VG) {
      views_.emplace_back();
      for (const auto& [group, X_VG] : poses) views_.back()[group] = to_block(X_VG);
    }
    add_points(data, options, state);
    if (state.coefficient_sigma > 0)
      add_prior(rms_per_coordinate(residuals(data, state)) / state.coefficient_sigma);
    hold_fixed(options, state);
  }

  bool solve() {
    ceres::Solver::Options settings;
    settings.linear_solver_type = ceres::DENSE_SCHUR;
    settings.max_num_iterations = 60;
    // Ceres orders blocks by address: only a converged solution is reproducible.
    settings.function_tolerance = 1e-13;
    settings.parameter_tolerance = 1e-11;
    settings.initial_trust_region_radius = 1e3;
    settings.logging_type = ceres::SILENT;
    settings.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (auto& view : views_)
      for (auto& [group, block] : view)
        settings.linear_solver_ordering->AddElementToGroup(block.data(), 0);
    for (Block& block : targets_)
      if (problem_.HasParameterBlock(block.data()))
        settings.linear_solver_ordering->AddElementToGroup(block.data(), 1);
    settings.linear_solver_ordering->AddElementToGroup(lens_.data(), 1);
    ceres::Solver::Summary summary;
    ceres::Solve(settings, &problem_, &summary);
    return summary.IsSolutionUsable() && lens_.allFinite();
  }

  void store(CalibrationState& state) const {
    set_numbers(state.camera, lens_);
    for (std::size_t t = 0; t < targets_.size(); ++t) state.X_GT[t] = to_pose(targets_[t]);
    for (std::size_t v = 0; v < views_.size(); ++v)
      for (const auto& [group, block] : views_[v]) state.X_VG[v][group] = to_pose(block);
  }

 private:
  void add_points(const CalibrationData& data, const BundleOptions& options,
                  const CalibrationState& state) {
    using Cost = ceres::AutoDiffCostFunction<PointCost, 2, kLensNumbers, 7, 7>;
    for (std::size_t v = 0; v < data.views.size(); ++v) {
      for (const TargetSighting& sighting : data.views[v].sightings) {
        const auto t = to_index(sighting.target);
        Block& X_VG = views_[v].at(state.group(sighting));
        for (const SeenPoint& seen : sighting.points) {
          auto* cost = new Cost(new PointCost(cost_of(data, state.camera, sighting, seen)));
          auto* loss = options.huber_px > 0 ? new ceres::HuberLoss(options.huber_px) : nullptr;
          problem_.AddResidualBlock(cost, loss, lens_.data(), X_VG.data(), targets_[t].data());
        }
      }
    }
  }

  /// @param weight_px  residual of a coefficient of 1: as probable as the noise so far
  void add_prior(double weight_px) {
    Eigen::Matrix<double, kLensNumbers, kLensNumbers> A =
        Eigen::Matrix<double, kLensNumbers, kLensNumbers>::Zero();
    for (int i = 4; i < kLensNumbers; ++i) A(i, i) = weight_px;
    problem_.AddResidualBlock(new ceres::NormalPrior(A, ceres::Vector::Zero(kLensNumbers)), nullptr,
                              lens_.data());
  }

  void hold_fixed(const BundleOptions& options, const CalibrationState& state) {
    for (auto& view : views_)
      for (auto& [group, block] : view)
        if (problem_.HasParameterBlock(block.data()))
          problem_.SetManifold(block.data(), new PoseManifold);
        else
          problem_.AddParameterBlock(block.data(), 7, new PoseManifold);
    for (std::size_t t = 0; t < targets_.size(); ++t) {
      if (!problem_.HasParameterBlock(targets_[t].data())) continue;
      problem_.SetManifold(targets_[t].data(), new PoseManifold);
      if (state.defines_group(t)) problem_.SetParameterBlockConstant(targets_[t].data());
    }
    std::vector<int> fixed;
    for (int i = 0; i < kLensNumbers; ++i)
      if (std::ranges::count(options.free, i) == 0) fixed.push_back(i);
    if (fixed.size() == kLensNumbers)
      problem_.SetParameterBlockConstant(lens_.data());
    else if (!fixed.empty())
      problem_.SetManifold(lens_.data(), new ceres::SubsetManifold(kLensNumbers, fixed));
  }

  LensVector lens_;
  std::vector<Block> targets_;
  std::vector<std::map<int, Block>> views_;
  ceres::Problem problem_;
};

}  // namespace

bool adjust(const CalibrationData& data, const BundleOptions& options, CalibrationState& state) {
  if (count_points(data) == 0) return false;
  Bundle bundle(data, options, state);
  if (!bundle.solve()) return false;
  bundle.store(state);
  return true;
}

std::vector<Eigen::Vector2d> residuals(const CalibrationData& data, const CalibrationState& state) {
  std::vector<Eigen::Vector2d> out;
  out.reserve(count_points(data));
  const LensVector lens = numbers_of(state.camera);
  for (std::size_t v = 0; v < data.views.size(); ++v) {
    for (const TargetSighting& sighting : data.views[v].sightings) {
      const auto t = to_index(sighting.target);
      const Block X_VG = to_block(state.X_VG[v].at(state.group(sighting)));
      const Block X_GT = to_block(state.X_GT[t]);
      for (const SeenPoint& seen : sighting.points) {
        Eigen::Vector2d r;
        cost_of(data, state.camera, sighting, seen)(lens.data(), X_VG.data(), X_GT.data(),
                                                    r.data());
        out.push_back(r);
      }
    }
  }
  return out;
}

double rms_per_coordinate(const std::vector<Eigen::Vector2d>& residuals) {
  double sum = 0;
  for (const Eigen::Vector2d& r : residuals) sum += r.squaredNorm();
  return residuals.empty() ? 0 : std::sqrt(sum / (2.0 * static_cast<double>(residuals.size())));
}

std::size_t count_unknowns(const CalibrationState& state, std::size_t free_lens_numbers) {
  std::size_t poses = 0;
  for (const auto& view : state.X_VG) poses += view.size();
  for (std::size_t t = 0; t < state.X_GT.size(); ++t) poses += state.defines_group(t) ? 0 : 1;
  return free_lens_numbers + 6 * poses;
}

}  // namespace fiducap
