#include "mapping/graph/graph_prior.hpp"

#include <algorithm>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "base/so3.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap {

namespace {

// What binds a tag to the others beyond so many is lost.
constexpr std::size_t kNeighbours = 4;
// Where all of it is does not count: 1-sigma, so large that it is nothing, so small that what
// remains is exact to the last digits that matter.
constexpr double kRoom_m = 0.3;
constexpr double kRoom_rad = 0.01;
// Nothing is known better than this: m and rad.
constexpr double kExact = 1e-6;
// Of a correlation: numbers that are known exactly have none.
constexpr double kRounding = 1e-12;

Matrix6d turn_of(const Pose& T) {
  Matrix6d R = Matrix6d::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = T.rotation();
  return R;
}

class Maker final {
 public:
  Maker(std::span<const PriorTag> tags, const PriorBetween& between, const PriorCameras& cameras,
        PriorUnknown unknown)
      : tags_(tags), between_(between), cameras_(cameras), is_in_(tags.size(), false) {
    for (const PriorTag& tag : tags) middle_ += tag.X_WT.p / static_cast<double>(tags.size());
    room_.head<3>().setConstant(kRoom_m * kRoom_m);
    room_.tail<3>().setConstant(kRoom_rad * kRoom_rad);
    if (unknown == PriorUnknown::kPlaceAndYaw) room_.segment<2>(3).setZero();
    if (unknown == PriorUnknown::kNothing) room_.setZero();
    out_.is_absolute = unknown == PriorUnknown::kNothing;
  }

  GraphPrior make() {
    for (const PriorTag& tag : tags_) {
      out_.tags.push_back(tag.tag);
      out_.expected.push_back(tag.X_WT);
    }
    hang_surveyed();
    while (const auto next = next_tag()) hang(*next);
    if (cameras_.covariance.size() > 0) {
      out_.cameras = cameras_.bodies;
      out_.camera_information = inverse(cameras_.covariance);
    }
    return std::move(out_);
  }

 private:
  void hang_surveyed() {
    for (std::size_t i = 0; i < tags_.size(); ++i) {
      if (!tags_[i].is_surveyed) continue;
      out_.hangings.push_back({i, {}, {}, Eigen::MatrixXd(6, 0), information(tags_[i].covariance)});
      is_in_[i] = true;
    }
  }

  /// One that hangs on those that are in, nearest first, that all know of each other. One that
  /// hangs on none begins a group of its own.
  std::optional<std::size_t> next_tag() {
    std::optional<std::size_t> best;
    std::size_t most = 0;
    for (std::size_t i = 0; i < tags_.size(); ++i) {
      if (is_in_[i]) continue;
      const std::size_t count = bound_[i];
      if (!best || count > most) {
        best = i;
        most = count;
      }
    }
    return best;
  }

  std::vector<std::size_t> neighbours(std::size_t i) const {
    std::vector<std::pair<double, std::size_t>> near;
    for (std::size_t k = 0; k < tags_.size(); ++k) {
      if (k != i && is_in_[k] && !tags_[k].is_surveyed && between_(i, k))
        near.emplace_back((tags_[i].X_WT.p - tags_[k].X_WT.p).norm(), k);
    }
    std::sort(near.begin(), near.end());
    std::vector<std::size_t> out;
    for (const auto& [distance, k] : near) {
      const bool all = std::all_of(out.begin(), out.end(),
                                   [&, k = k](std::size_t other) { return between_(k, other); });
      if (all) out.push_back(k);
      if (out.size() == kNeighbours) break;
    }
    return out;
  }

  /// Errors of a common shift and turn about the middle.
  Matrix6d common(std::size_t i) const {
    Matrix6d N = Matrix6d::Identity();
    N.topRightCorner<3, 3>() = -skew(tags_[i].X_WT.p - middle_);
    return N;
  }

  Matrix6d with_room(std::size_t a, std::size_t b, const Matrix6d& covariance) const {
    return covariance + common(a) * room_.asDiagonal() * common(b).transpose();
  }

  void hang(std::size_t i) {
    const auto on = neighbours(i);
    const auto parents = static_cast<Eigen::Index>(6 * on.size());
    const Eigen::Index numbers = cameras_.covariance.rows();
    Eigen::MatrixXd joint(parents + numbers, parents + numbers);
    Eigen::MatrixXd across(6, parents + numbers);
    for (std::size_t a = 0; a < on.size(); ++a) {
      const auto at = static_cast<Eigen::Index>(6 * a);
      across.middleCols<6>(at) = with_room(i, on[a], *between_(i, on[a]));
      for (std::size_t b = 0; b < on.size(); ++b) {
        const Matrix6d own = a == b ? tags_[on[a]].covariance : *between_(on[a], on[b]);
        joint.block<6, 6>(at, static_cast<Eigen::Index>(6 * b)) = with_room(on[a], on[b], own);
      }
      if (numbers == 0) continue;
      joint.block(at, parents, 6, numbers) = cameras_.of_tags[on[a]];
      joint.block(parents, at, numbers, 6) = cameras_.of_tags[on[a]].transpose();
    }
    if (numbers > 0) {
      joint.bottomRightCorner(numbers, numbers) = cameras_.covariance;
      across.rightCols(numbers) = cameras_.of_tags[i];
    }
    const Eigen::MatrixXd G = across * inverse(joint);
    const Matrix6d own = with_room(i, i, tags_[i].covariance);
    out_.hangings.push_back({i, on, G.leftCols(parents), G.rightCols(numbers),
                             information(own - G * across.transpose())});
    is_in_[i] = true;
    for (std::size_t k = 0; k < tags_.size(); ++k)
      if (!is_in_[k] && between_(i, k)) ++bound_[k];
  }

  /// By correlations, whose numbers are alike.
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
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(0.5 *
                                                        (covariance + covariance.transpose()));
    const Vector6d values = eigen.eigenvalues().cwiseMax(kExact * kExact).cwiseInverse();
    return eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
  }

  std::span<const PriorTag> tags_;
  const PriorBetween& between_;
  const PriorCameras& cameras_;
  std::vector<bool> is_in_;
  std::vector<std::size_t> bound_ = std::vector<std::size_t>(tags_.size(), 0);
  Eigen::Vector3d middle_{Eigen::Vector3d::Zero()};
  Vector6d room_;
  GraphPrior out_;
};

}  // namespace

void GraphPrior::move(const Pose& T) {
  const Matrix6d R = turn_of(T);
  for (Pose& X : expected) X = T * X;
  for (Hanging& hanging : hangings) {
    for (std::size_t k = 0; k < hanging.on.size(); ++k) {
      auto A = hanging.A.middleCols<6>(static_cast<Eigen::Index>(6 * k));
      A = (R * A * R.transpose()).eval();
    }
    hanging.C = R * hanging.C;
    hanging.information = R * hanging.information * R.transpose();
  }
}

void GraphPrior::hold(std::size_t tag, const Pose& X_WT, bool level) {
  constexpr double kInformation = 1 / (kExact * kExact);
  Matrix6d information = Matrix6d::Zero();
  information.diagonal().setConstant(kInformation);
  if (level) {
    // Of a sloping axis the heading changes as well when the tag tilts.
    const int axis = make_heading_rule({}, X_WT.q).axis;
    const Eigen::Vector3d h = X_WT.q * Eigen::Vector3d::Unit(axis);
    Eigen::Vector3d heading = Eigen::Vector3d::UnitZ();
    heading.head<2>() = -h.z() / h.head<2>().squaredNorm() * h.head<2>();
    information.bottomRightCorner<3, 3>() = kInformation * heading * heading.transpose();
  }
  hangings.push_back({tags.size(), {}, {}, Eigen::MatrixXd(6, 0), information});
  tags.push_back(tag);
  expected.push_back(X_WT);
  is_absolute = true;
}

void GraphPrior::renumber(const std::vector<std::size_t>& now) {
  for (std::size_t& tag : tags) tag = now[tag];
}

GraphPrior make_prior(std::span<const PriorTag> tags, const PriorBetween& between,
                      const PriorCameras& cameras, PriorUnknown unknown) {
  return Maker(tags, between, cameras, unknown).make();
}

}  // namespace fiducap
