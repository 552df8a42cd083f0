#include "mapping/refinement.hpp"

#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include <ceres/ceres.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "mapping/refinement_residuals.hpp"

namespace fiducap {

namespace {

constexpr int kMaxIterations = 100;
// Relative change of the cost. Long chains of tags bend at next to no cost: a looser bound stops
// while metres still move by centimetres.
constexpr double kConverged = 1e-8;
// Starts come from a filter: nearly Gauss–Newton from the first step on. Ceres' own 1e4 holds those
// chains stiff.
constexpr double kFirstTrustRegion = 1e8;
constexpr double kUnit = 1e-3;  // further from 1 a quaternion is a mistake, not rounding

/// A pose as Ceres keeps it: q (x y z w), then p.
using Block = std::array<double, 7>;
using PoseManifold =
    ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>;

Block to_block(const Pose& X) {
  return {X.q.x(), X.q.y(), X.q.z(), X.q.w(), X.p.x(), X.p.y(), X.p.z()};
}

Pose to_pose(const double* b) {
  return {Eigen::Quaterniond(b[3], b[0], b[1], b[2]).normalized(), {b[4], b[5], b[6]}};
}

/// Carries a derivative by (position, rotation vector in W) to the seven numbers of a block. Ceres
/// multiplies it with the derivative E of the manifold's plus; E has orthonormal columns and a step
/// of half the rotation vector.
template <int N>
void lift(const Eigen::Matrix<double, N, 6>& J, const double* b, double* out) {
  if (out == nullptr) return;
  Eigen::Matrix<double, 4, 3> E;
  E << b[3], b[2], -b[1],  //
      -b[2], b[3], b[0],   //
      b[1], -b[0], b[3],   //
      -b[0], -b[1], -b[2];
  Eigen::Map<Eigen::Matrix<double, N, 7, Eigen::RowMajor>> lifted(out);
  lifted.template leftCols<4>() = 2.0 * J.template rightCols<3>() * E.transpose();
  lifted.template rightCols<3>() = J.template leftCols<3>();
}

class SightingCost final : public ceres::SizedCostFunction<8, 7, 7> {
 public:
  SightingCost(const TagObservation& seen, const CameraMount& camera, double noise_px)
      : seen_(seen), camera_(camera), noise_px_(noise_px) {}

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const SightingResidual r =
        sighting_residual(seen_, camera_, to_pose(blocks[0]), to_pose(blocks[1]));
    Eigen::Map<Vector8d> y(residuals);
    // Behind the camera nothing pulls; the cost is that of a tag a whole image away, so no step
    // wants to go there.
    y = r.in_front ? Vector8d(r.y / noise_px_)
                   : Vector8d::Constant(camera_.model.width / noise_px_);
    if (jacobians == nullptr) return true;
    lift<8>(r.d_body / noise_px_, blocks[0], jacobians[0]);
    lift<8>(r.d_tag / noise_px_, blocks[1], jacobians[1]);
    return true;
  }

 private:
  const TagObservation& seen_;
  const CameraMount& camera_;
  double noise_px_;
};

class PriorCost final : public ceres::SizedCostFunction<6, 7> {
 public:
  PriorCost(const Pose& X_WT, const Matrix6d& covariance_root)
      : X_WT_(X_WT),
        whitening_(covariance_root.triangularView<Eigen::Lower>().solve(Matrix6d::Identity())) {}

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const PriorResidual r = prior_residual(to_pose(blocks[0]), X_WT_);
    Eigen::Map<Eigen::Matrix<double, 6, 1>> y(residuals);
    y = whitening_ * r.y;
    if (jacobians != nullptr) lift<6>(whitening_ * r.d_tag, blocks[0], jacobians[0]);
    return true;
  }

 private:
  Pose X_WT_;
  Matrix6d whitening_;
};

bool is_pose(const Pose& X) {
  return X.p.allFinite() && X.q.coeffs().allFinite() && std::abs(X.q.norm() - 1.0) < kUnit;
}

std::string tag_name(const KnownTag& tag) { return "tag " + std::to_string(tag.tag_id); }

/// Corners that can be carried back through the lens.
bool is_seen(const TagObservation& tag) {
  bool sound = std::isfinite(tag.edge_m) && tag.edge_m > 0;
  for (std::size_t i = 0; i < tag.corners_px.size(); ++i) {
    const double area = std::abs(tag.ideal_from_raw[i].determinant());
    sound = sound && tag.corners_px[i].allFinite() && std::isfinite(area) && area > 0;
  }
  return sound;
}

Expected<void> check_tags(const RefinementProblem& problem) {
  std::set<int> ids;
  for (const auto* tags : {&problem.fixed, &problem.estimated}) {
    for (const KnownTag& tag : *tags) {
      if (!ids.insert(tag.tag_id).second)
        return fail(ErrorCode::kInvalid, "an id may come once", tag_name(tag));
      if (!is_pose(tag.X_WT))
        return fail(ErrorCode::kInvalid, "the start needs finite numbers and a unit quaternion",
                    tag_name(tag));
    }
  }
  for (const KnownTag& prior : problem.priors) {
    if (!is_pose(prior.X_WT))
      return fail(ErrorCode::kInvalid, "the prior needs finite numbers and a unit quaternion",
                  tag_name(prior));
    if (!prior.covariance.allFinite() || prior.covariance.llt().info() != Eigen::Success)
      return fail(ErrorCode::kInvalid,
                  "the prior needs a positive definite covariance; an exact one is a fixed tag",
                  tag_name(prior));
  }
  return {};
}

Expected<void> check(const RefinementProblem& problem) {
  if (!(std::isfinite(problem.corner_noise_px) && problem.corner_noise_px > 0))
    return fail(ErrorCode::kInvalid,
                "corner_noise_px = " + std::to_string(problem.corner_noise_px) +
                    ": must be finite and > 0");
  for (std::size_t i = 0; i < problem.frames.size(); ++i) {
    const RefinementFrame& frame = problem.frames[i];
    const std::string name = "frame " + std::to_string(i);
    if (!is_pose(frame.X_WB))
      return fail(ErrorCode::kInvalid, "the start needs finite numbers and a unit quaternion",
                  name);
    for (const TagObservations& image : frame.images) {
      if (image.camera < 0 || static_cast<std::size_t>(image.camera) >= problem.cameras.size())
        return fail(ErrorCode::kInvalid,
                    "camera " + std::to_string(image.camera) + " of " +
                        std::to_string(problem.cameras.size()),
                    name);
      for (const TagObservation& tag : image.tags) {
        if (!is_seen(tag))
          return fail(ErrorCode::kInvalid,
                      "tag " + std::to_string(tag.tag_id) +
                          " needs an edge > 0, finite corners and invertible lens derivatives",
                      name);
      }
    }
  }
  return check_tags(problem);
}

/// The least squares problem in Ceres' terms; the blocks live here.
class Bundle final {
 public:
  explicit Bundle(const RefinementProblem& problem)
      : problem_(problem), loss_(std::sqrt(kLossBend)), ceres_(borrowing()) {
    for (const RefinementFrame& frame : problem.frames) bodies_.push_back(to_block(frame.X_WB));
    for (const auto* tags : {&problem.fixed, &problem.estimated})
      for (const KnownTag& tag : *tags) tags_[tag.tag_id] = to_block(tag.X_WT);
    for (std::size_t i = 0; i < bodies_.size(); ++i) add_frame(problem.frames[i], bodies_[i]);
    if (!seen_.empty()) add_knowledge();
  }

  [[nodiscard]] bool empty() const { return seen_.empty(); }

  Expected<RefinementResult> solve() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_SCHUR;
    // Not SuiteSparse: its BLAS starts threads of its own.
    options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (Block& body : bodies_)
      if (ceres_.HasParameterBlock(body.data()))
        options.linear_solver_ordering->AddElementToGroup(body.data(), 0);
    for (auto& [id, tag] : tags_)
      if (ceres_.HasParameterBlock(tag.data()))
        options.linear_solver_ordering->AddElementToGroup(tag.data(), 1);
    options.max_num_iterations = kMaxIterations;
    options.function_tolerance = kConverged;
    options.initial_trust_region_radius = kFirstTrustRegion;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &ceres_, &summary);
    if (!summary.IsSolutionUsable())
      return fail(ErrorCode::kInvalid, summary.message, "refinement");
    return result(summary);
  }

 private:
  static ceres::Problem::Options borrowing() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  void add_frame(const RefinementFrame& frame, Block& body) {
    for (const TagObservations& image : frame.images) {
      const CameraMount& camera = problem_.cameras[static_cast<std::size_t>(image.camera)];
      for (const TagObservation& seen : image.tags) {
        const auto tag = tags_.find(seen.tag_id);
        if (tag == tags_.end()) continue;
        ceres_.AddParameterBlock(body.data(), 7, &manifold_);
        ceres_.AddParameterBlock(tag->second.data(), 7, &manifold_);
        ceres_.AddResidualBlock(new SightingCost(seen, camera, problem_.corner_noise_px), &loss_,
                                body.data(), tag->second.data());
        seen_.insert(seen.tag_id);
      }
    }
  }

  /// What says where W is: fixed tags, priors, or one tag that is held.
  void add_knowledge() {
    bool anchored = false;
    for (const KnownTag& tag : problem_.fixed) {
      if (!seen_.contains(tag.tag_id)) continue;
      ceres_.SetParameterBlockConstant(tags_[tag.tag_id].data());
      anchored = true;
    }
    for (const KnownTag& tag : problem_.estimated) {
      for (const KnownTag& prior : problem_.priors) {
        if (prior.tag_id != tag.tag_id) continue;
        Block& block = tags_[tag.tag_id];
        ceres_.AddParameterBlock(block.data(), 7, &manifold_);
        ceres_.AddResidualBlock(new PriorCost(prior.X_WT, prior.covariance.llt().matrixL()),
                                nullptr, block.data());
        anchored = true;
      }
    }
    if (anchored) return;
    const int gauge = problem_.gauge_tag && seen_.contains(*problem_.gauge_tag)
                          ? *problem_.gauge_tag
                          : first_seen();
    ceres_.SetParameterBlockConstant(tags_[gauge].data());
  }

  [[nodiscard]] int first_seen() const {
    for (const KnownTag& tag : problem_.estimated)
      if (seen_.contains(tag.tag_id)) return tag.tag_id;
    return *seen_.begin();
  }

  [[nodiscard]] RefinementResult result(const ceres::Solver::Summary& summary) const {
    RefinementResult out;
    out.tags = problem_.estimated;
    for (KnownTag& tag : out.tags) tag.X_WT = to_pose(tags_.at(tag.tag_id).data());
    for (const Block& body : bodies_) out.X_WB.push_back(to_pose(body.data()));
    out.initial_cost = summary.initial_cost;
    out.final_cost = summary.final_cost;
    out.iterations = static_cast<int>(summary.iterations.size());
    return out;
  }

  const RefinementProblem& problem_;
  PoseManifold manifold_;
  ceres::CauchyLoss loss_;
  std::vector<Block> bodies_;
  std::map<int, Block> tags_;
  std::set<int> seen_;
  ceres::Problem ceres_;  ///< Last: goes before the blocks it points to.
};

}  // namespace

Expected<RefinementResult> refine(const RefinementProblem& problem) {
  if (auto sound = check(problem); !sound) return tl::unexpected(sound.error());
  Bundle bundle(problem);
  if (bundle.empty())
    return fail(ErrorCode::kInvalid,
                "needs images that see a fixed or an estimated tag; there is none", "refinement");
  return bundle.solve();
}

}  // namespace fiducap
