#include "mapping/graph/graph_prior.hpp"

#include <algorithm>
#include <utility>

#include <Eigen/Cholesky>

#include "base/pose.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/filter/matrix6.hpp"

namespace fiducap {

namespace {

// A tag is conditioned on at most this many; its other correlations are lost.
constexpr std::size_t kNeighbours = 4;
// Sigma of a common shift and rotation of the whole, where the gauge is free: large against all
// correlations, small enough for the relative precision.
constexpr double kCommon_m = 0.3;
constexpr double kCommon_rad = 0.01;
// Lower bound of all sigmas: m and rad.
constexpr double kExact = 1e-6;
// Added to the diagonal of correlations: exact parameters have none.
constexpr double kRounding = 1e-12;

Matrix6d rotation6_of(const Pose& T) {
  Matrix6d R = Matrix6d::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = T.rotation();
  return R;
}

class PriorMaker final {
 public:
  PriorMaker(std::span<const PriorTag> tags, const PriorBetween& between,
             const PriorCameras& cameras, PriorUnknown unknown)
      : tags_(tags), between_(between), cameras_(cameras), is_in_(tags.size(), false) {
    for (const PriorTag& tag : tags) middle_ += tag.X_WT.p / static_cast<double>(tags.size());
    common_variance_.head<3>().setConstant(kCommon_m * kCommon_m);
    common_variance_.tail<3>().setConstant(kCommon_rad * kCommon_rad);
    if (unknown == PriorUnknown::kPlaceAndYaw) common_variance_.segment<2>(3).setZero();
    if (unknown == PriorUnknown::kNothing) common_variance_.setZero();
    out_.is_absolute = unknown == PriorUnknown::kNothing;
  }

  GraphPrior make() {
    for (const PriorTag& tag : tags_) {
      out_.tags.push_back(tag.tag);
      out_.expected.push_back(tag.X_WT);
    }
    add_surveyed();
    while (const auto next = next_tag()) add(*next);
    if (cameras_.covariance.size() > 0) {
      out_.cameras = cameras_.bodies;
      out_.camera_information = inverse(cameras_.covariance);
    }
    return std::move(out_);
  }

 private:
  void add_surveyed() {
    for (std::size_t i = 0; i < tags_.size(); ++i) {
      if (!tags_[i].is_surveyed) continue;
      out_.conditionals.push_back(
          {i, {}, {}, Eigen::MatrixXd(6, 0), information(tags_[i].covariance)});
      is_in_[i] = true;
    }
  }

  /// The tag with most correlations to those added before; with none, the first of a new group.
  std::optional<std::size_t> next_tag() {
    std::optional<std::size_t> best;
    for (std::size_t i = 0; i < tags_.size(); ++i)
      if (!is_in_[i] && (!best || bound_[i] > bound_[*best])) best = i;
    return best;
  }

  /// Tags to condition on: added before, nearest first, all correlated with each other.
  std::vector<std::size_t> neighbours(std::size_t i) const {
    std::vector<std::pair<double, std::size_t>> near;
    for (std::size_t k = 0; k < tags_.size(); ++k) {
      if (k != i && is_in_[k] && !tags_[k].is_surveyed && between_(i, k))
        near.emplace_back((tags_[i].X_WT.p - tags_[k].X_WT.p).norm(), k);
    }
    std::ranges::sort(near);
    std::vector<std::size_t> out;
    for (const auto& [distance, nearer] : near) {
      const bool all = std::ranges::all_of(
          out, [&, k = nearer](std::size_t other) { return between_(k, other).has_value(); });
      if (all) out.push_back(nearer);
      if (out.size() == kNeighbours) break;
    }
    return out;
  }

  /// Jacobian of a common shift and rotation about the middle.
  Matrix6d common(std::size_t i) const {
    Matrix6d N = Matrix6d::Identity();
    N.topRightCorner<3, 3>() = -skew(tags_[i].X_WT.p - middle_);
    return N;
  }

  Matrix6d with_common(std::size_t a, std::size_t b, const Matrix6d& covariance) const {
    return covariance + common(a) * common_variance_.asDiagonal() * common(b).transpose();
  }

  void add(std::size_t i) {
    const auto given = neighbours(i);
    const auto parents = static_cast<Eigen::Index>(6 * given.size());
    const Eigen::Index numbers = cameras_.covariance.rows();
    Eigen::MatrixXd joint(parents + numbers, parents + numbers);
    Eigen::MatrixXd across(6, parents + numbers);
    for (std::size_t a = 0; a < given.size(); ++a) {
      const auto at = static_cast<Eigen::Index>(6 * a);
      across.middleCols<6>(at) = with_common(i, given[a], *between_(i, given[a]));
      for (std::size_t b = 0; b < given.size(); ++b) {
        const Matrix6d own = a == b ? tags_[given[a]].covariance : *between_(given[a], given[b]);
        joint.block<6, 6>(at, static_cast<Eigen::Index>(6 * b)) =
            with_common(given[a], given[b], own);
      }
      if (numbers == 0) continue;
      joint.block(at, parents, 6, numbers) = cameras_.of_tags[given[a]];
      joint.block(parents, at, numbers, 6) = cameras_.of_tags[given[a]].transpose();
    }
    if (numbers > 0) {
      joint.bottomRightCorner(numbers, numbers) = cameras_.covariance;
      across.rightCols(numbers) = cameras_.of_tags[i];
    }
    const Eigen::MatrixXd G = across * inverse(joint);
    const Matrix6d own = with_common(i, i, tags_[i].covariance);
    out_.conditionals.push_back({i, given, G.leftCols(parents), G.rightCols(numbers),
                                 information(own - G * across.transpose())});
    is_in_[i] = true;
    for (std::size_t k = 0; k < tags_.size(); ++k)
      if (!is_in_[k] && between_(i, k)) ++bound_[k];
  }

  /// Scaled to correlations, which are well conditioned.
  static Eigen::MatrixXd inverse(const Eigen::MatrixXd& covariance) {
    if (covariance.size() == 0) return covariance;
    const Eigen::VectorXd scale =
        covariance.diagonal().cwiseMax(kExact * kExact * kRounding).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
    correlation.diagonal().array() += kRounding;
    const Eigen::MatrixXd inverse =
        correlation.ldlt().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
    const Eigen::MatrixXd out = scale.asDiagonal() * inverse * scale.asDiagonal();
    return 0.5 * (out + out.transpose());
  }

  static Matrix6d information(const Matrix6d& covariance) {
    const SymmetricEigen6 eigen = symmetric_eigen(0.5 * (covariance + covariance.transpose()));
    const Vector6d values = eigen.values.cwiseMax(kExact * kExact).cwiseInverse();
    return eigen.V * values.asDiagonal() * eigen.V.transpose();
  }

  std::span<const PriorTag> tags_;
  const PriorBetween& between_;
  const PriorCameras& cameras_;
  std::vector<bool> is_in_;
  std::vector<std::size_t> bound_ = std::vector<std::size_t>(tags_.size(), 0);
  Eigen::Vector3d middle_{Eigen::Vector3d::Zero()};
  Vector6d common_variance_;
  GraphPrior out_;
};

}  // namespace

void GraphPrior::move(const Pose& T) {
  const Matrix6d R = rotation6_of(T);
  for (Pose& X : expected) X = T * X;
  for (Conditional& conditional : conditionals) {
    for (std::size_t k = 0; k < conditional.given.size(); ++k) {
      auto A = conditional.A.middleCols<6>(static_cast<Eigen::Index>(6 * k));
      A = (R * A * R.transpose()).eval();
    }
    conditional.C = R * conditional.C;
    conditional.information = R * conditional.information * R.transpose();
  }
}

void GraphPrior::hold(std::size_t tag, const Pose& X_WT, bool level) {
  constexpr double kInformation = 1 / (kExact * kExact);
  Matrix6d information = Matrix6d::Zero();
  information.diagonal().setConstant(kInformation);
  if (level) {
    // Tilting the tag also changes the heading of a sloping axis.
    const int axis = make_heading_rule({}, X_WT.q).axis;
    const Eigen::Vector3d h = X_WT.q * Eigen::Vector3d::Unit(axis);
    Eigen::Vector3d heading = Eigen::Vector3d::UnitZ();
    heading.head<2>() = -h.z() / h.head<2>().squaredNorm() * h.head<2>();
    information.bottomRightCorner<3, 3>() = kInformation * heading * heading.transpose();
  }
  conditionals.push_back({tags.size(), {}, {}, Eigen::MatrixXd(6, 0), information});
  tags.push_back(tag);
  expected.push_back(X_WT);
  is_absolute = true;
}

void GraphPrior::renumber(const std::vector<std::size_t>& now) {
  for (std::size_t& tag : tags) tag = now[tag];
}

GraphPrior make_prior(std::span<const PriorTag> tags, const PriorBetween& between,
                      const PriorCameras& cameras, PriorUnknown unknown) {
  return PriorMaker(tags, between, cameras, unknown).make();
}

}  // namespace fiducap
