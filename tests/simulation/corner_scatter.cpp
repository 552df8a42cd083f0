#include "simulation/corner_scatter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>

#include "detection/corner_sigma.hpp"
#include "detection/observe.hpp"

namespace fiducap {

namespace {

using bound::Matrix8;

constexpr double kMisread_px = 1.0;
constexpr double kMisreadSigmas = 10.0;
// Images further apart than this are no neighbours.
constexpr double kNext_s = 0.15;

bool is_misread(const CornerError& error) {
  return error.off_px.cwiseAbs().maxCoeff() >
         std::max(kMisread_px, kMisreadSigmas * error.sigma_px);
}

/// Raw coordinates of the corners to those away from the tag's middle and across.
Matrix8 outwards(const std::array<Eigen::Vector2d, 4>& px) {
  const Eigen::Vector2d middle = 0.25 * (px[0] + px[1] + px[2] + px[3]);
  Matrix8 out = Matrix8::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d away = (px[i] - middle).normalized();
    const auto at = static_cast<Eigen::Index>(2 * i);
    out.block<2, 2>(at, at) << away.x(), away.y(), -away.y(), away.x();
  }
  return out;
}

/// Of a number with the same one in the next image.
struct Lasting {
  double product{};
  double square{};

  void add(const Vector8d& before, const Vector8d& now) {
    product += now.dot(before);
    square += 0.5 * (now.squaredNorm() + before.squaredNorm());
  }
  [[nodiscard]] double correlation() const { return product / square; }
};

/// Errors in sigmas of one tag while it is in view.
struct Visit {
  Vector8d sum{Vector8d::Zero()};
  Matrix8 squares{Matrix8::Zero()};
  int count{};
  const CornerError* last{};

  void add(const CornerError& error, const Vector8d& in_sigmas) {
    sum += in_sigmas;
    squares += in_sigmas * in_sigmas.transpose();
    ++count;
    last = &error;
  }
};

/// Variances among the images of a visit and among visits: each visit's mean has its share of what
/// passes in it, too.
class Variances {
 public:
  void add(const Visit& visit) {
    const Matrix8 means = visit.sum * visit.sum.transpose() / visit.count;
    within_ += visit.squares - means;
    between_ += means;
    sightings_ += visit.count;
    ++visits_;
  }
  [[nodiscard]] Matrix8 passing() const { return within_ / std::max(1, sightings_ - visits_); }
  [[nodiscard]] Matrix8 lasting() const {
    const Matrix8 found = (between_ - visits_ * passing()) / std::max(1, sightings_);
    const Eigen::SelfAdjointEigenSolver<Matrix8> eigen(found);
    return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
           eigen.eigenvectors().transpose();
  }

 private:
  Matrix8 within_{Matrix8::Zero()};
  Matrix8 between_{Matrix8::Zero()};
  int sightings_{};
  int visits_{};
};

/// Root of a covariance that may have no inverse.
Matrix8 root_of(const Matrix8& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix8> eigen(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

}  // namespace

std::vector<CornerError> corner_errors(const EstimationData& data) {
  std::vector<CornerError> out;
  TagObservations seen;
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image == nullptr) continue;
    observe(*image, data.camera.model, data.tag_set, {}, seen);
    const Pose X_VW =
        (data.truth_near(image->exposed_at - image->clock_shift).X_WB * data.camera.X_BV).inverse();
    for (const TagObservation& tag : seen.tags) {
      const RecordedTag* truth = data.tag(tag.tag_id);
      if (truth == nullptr) continue;
      const CornerResidual residual = corner_residual(tag, X_VW * truth->X_WT, data.camera.model);
      if (!residual.in_front) continue;
      const auto seen_as =
          std::find_if(image->tags.begin(), image->tags.end(),
                       [&](const TagSighting& one) { return one.tag_id == tag.tag_id; });
      out.push_back({image->exposed_at, tag.tag_id, tag.raw_px, residual.y,
                     corner_sigma_px(*seen_as, image->pixel_noise)});
    }
  }
  return out;
}

double CornerScatter::excess() const { return std::sqrt(chi_square); }

double CornerScatter::lasting_share() const {
  return lasting.trace() / (lasting.trace() + passing.trace());
}

CornerScatter corner_scatter(const std::vector<CornerError>& errors) {
  CornerScatter out;
  std::map<int, Visit> visits;
  Variances variances;
  double square = 0;
  Lasting in_px;
  for (const CornerError& error : errors) {
    if (is_misread(error)) continue;
    ++out.sightings;
    square += error.off_px.squaredNorm();
    out.chi_square += error.off_px.squaredNorm() / (8 * error.sigma_px * error.sigma_px);
    Visit& visit = visits[error.tag_id];
    if (visit.count > 0) {
      if (to_seconds(error.at - visit.last->at) < kNext_s)
        in_px.add(visit.last->off_px, error.off_px);
      if (error.at - visit.last->at > bound::LastingErrors{}.visit_ends) {
        variances.add(visit);
        visit = {};
      }
    }
    visit.add(error, outwards(error.seen_px) * error.off_px / error.sigma_px);
  }
  for (const auto& [tag_id, visit] : visits) variances.add(visit);
  out.rms_px = std::sqrt(square / (8.0 * out.sightings));
  out.chi_square /= out.sightings;
  if (!std::isfinite(out.chi_square)) out.chi_square = std::nan("");
  out.to_next = in_px.correlation();
  out.passing = variances.passing();
  out.lasting = variances.lasting();
  return out;
}

BoundRun white_bound(const EstimationData& data, KnowledgeCase knowledge,
                     const CornerScatter& scatter) {
  const auto whiten = [&](const CornerFrame& image, const TagSighting& tag) {
    const double sigma_px = scatter.excess() * corner_sigma_px(tag, image.pixel_noise);
    return Matrix8(Matrix8::Identity() / sigma_px);
  };
  return run_bound(data, knowledge, whiten, std::nullopt);
}

BoundRun scatter_bound(const EstimationData& data, KnowledgeCase knowledge,
                       const CornerScatter& scatter) {
  const Matrix8 passing = root_of(scatter.passing);
  const Matrix8 whiten_sigmas = passing.inverse();
  const auto whiten = [&](const CornerFrame& image, const TagSighting& tag) {
    return Matrix8(whiten_sigmas * outwards(tag.corners_px) /
                   corner_sigma_px(tag, image.pixel_noise));
  };
  return run_bound(data, knowledge, whiten,
                   bound::LastingErrors{.root = whiten_sigmas * root_of(scatter.lasting)});
}

}  // namespace fiducap
