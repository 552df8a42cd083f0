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
// Pairs of sightings for the persistent part, and others for its duration.
constexpr double kNear_s = 0.3;
constexpr double kFarFrom_s = 0.75;
constexpr double kFarTo_s = 1.25;
constexpr double kLeastFades_s = 0.3;
constexpr double kMostFades_s = 30;
// Least share of errors that are new in every image.
constexpr double kLeastPassing = 0.1;
constexpr int kFewestPairs = 500;
constexpr double kModules = 8;

bool is_misread(const CornerError& error) {
  return error.off_px.cwiseAbs().maxCoeff() >
         std::max(kMisread_px, kMisreadSigmas * error.sigma_px);
}

/// Turns raw coordinates of corners into radial (from the tag's middle) and tangential ones.
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

/// Correlation of errors with those in the next image.
struct Lasting {
  double product{};
  double square{};

  void add(const Vector8d& before, const Vector8d& now) {
    product += now.dot(before);
    square += 0.5 * (now.squaredNorm() + before.squaredNorm());
  }
  [[nodiscard]] double correlation() const { return product / square; }
};

/// One sighting, in sigmas.
struct InSigmas {
  Instant at;
  double module_px{};
  Vector8d error;
};

/// Products of errors with errors of the same tag somewhat later.
struct LaterProducts {
  Matrix8 sum{Matrix8::Zero()};
  double seconds{};
  int pairs{};

  void add(const InSigmas& before, const InSigmas& now) {
    const Matrix8 product = before.error * now.error.transpose();
    sum += 0.5 * (product + product.transpose());
    seconds += to_seconds(now.at - before.at);
    ++pairs;
  }
  [[nodiscard]] Matrix8 mean() const { return sum / std::max(1, pairs); }
  [[nodiscard]] double mean_s() const { return seconds / std::max(1, pairs); }
};

/// Of one class of tags.
struct Products {
  Matrix8 at_once{Matrix8::Zero()};
  int sightings{};
  LaterProducts near, far;

  void add(const std::vector<InSigmas>& visit, std::size_t i) {
    const InSigmas& now = visit[i];
    at_once += now.error * now.error.transpose();
    ++sightings;
    for (std::size_t k = i; k-- > 0;) {
      const double apart_s = to_seconds(now.at - visit[k].at);
      if (apart_s > kFarTo_s) break;
      if (apart_s <= kNear_s) near.add(visit[k], now);
      if (apart_s >= kFarFrom_s) far.add(visit[k], now);
    }
  }
};

/// With eigenvalues of at least `least`.
Matrix8 positive(const Matrix8& found, double least) {
  const Eigen::SelfAdjointEigenSolver<Matrix8> eigen(found);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(least).asDiagonal() *
         eigen.eigenvectors().transpose();
}

/// From the decrease of the correlation with time.
double fading_time(const Products& narrow, const Products& wide) {
  const double near = narrow.near.sum.trace() + wide.near.sum.trace();
  const double far = narrow.far.sum.trace() + wide.far.sum.trace();
  const int near_pairs = narrow.near.pairs + wide.near.pairs;
  const int far_pairs = narrow.far.pairs + wide.far.pairs;
  if (near_pairs == 0 || far_pairs == 0 || !(near > 0)) return kLeastFades_s;
  const double left = (far / far_pairs) / (near / near_pairs);
  const double apart_s = (narrow.far.seconds + wide.far.seconds) / far_pairs -
                         (narrow.near.seconds + wide.near.seconds) / near_pairs;
  if (!(left > 0)) return kLeastFades_s;
  return left < 1 ? std::clamp(-apart_s / std::log(left), kLeastFades_s, kMostFades_s)
                  : kMostFades_s;
}

ScatterShare share_of(const Products& of, double fades_s) {
  ScatterShare out;
  if (of.sightings == 0) return out;
  const Matrix8 all = of.at_once / of.sightings;
  if (of.near.pairs >= kFewestPairs)
    out.lasting = positive(of.near.mean() * std::exp(of.near.mean_s() / fades_s), 0.0);
  out.passing = positive(all - out.lasting, kLeastPassing * all.trace() / 8);
  return out;
}

/// Root of a covariance that may have no inverse.
Matrix8 root_of(const Matrix8& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix8> eigen(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// Sorts one run's errors by tag and visit.
class Visits {
 public:
  Visits(Products& narrow, Products& wide) : narrow_(narrow), wide_(wide) {}

  void add(const CornerError& error) {
    std::vector<InSigmas>& visit = visits_[error.tag_id];
    if (!visit.empty() && error.at - visit.back().at > bound::LastingErrors{}.visit_ends)
      visit.clear();
    visit.push_back({error.at, outline_of(error.seen_px).width_px / kModules,
                     outwards(error.seen_px) * error.off_px / error.sigma_px});
    const bool is_narrow = visit.back().module_px < CornerScatter::kNarrow_px;
    (is_narrow ? narrow_ : wide_).add(visit, visit.size() - 1);
  }

 private:
  Products& narrow_;
  Products& wide_;
  std::map<int, std::vector<InSigmas>> visits_;
};

}  // namespace

std::vector<CornerError> corner_errors(const EstimationData& data) {
  std::vector<CornerError> out;
  TagObservations seen;
  for_each_image(data, [&](const CornerFrame& image) {
    observe(image, data.camera.model, data.tag_set, {}, seen);
    const Pose X_VW =
        (data.truth_near(image.exposed_at - image.clock_shift).X_WB * data.camera.X_BV).inverse();
    for (const TagObservation& tag : seen.tags) {
      const RecordedTag* truth = data.tag(tag.tag_id);
      if (truth == nullptr) continue;
      const CornerResidual residual = corner_residual(tag, X_VW * truth->X_WT, data.camera.model);
      if (!residual.in_front) continue;
      const auto seen_as =
          std::find_if(image.tags.begin(), image.tags.end(),
                       [&](const TagSighting& one) { return one.tag_id == tag.tag_id; });
      out.push_back({image.exposed_at, tag.tag_id, tag.raw_px, residual.y,
                     corner_sigma_px(*seen_as, image.pixel_noise)});
    }
  });
  return out;
}

double CornerScatter::excess() const { return std::sqrt(chi_square); }

CornerScatter corner_scatter(std::span<const std::vector<CornerError>> runs) {
  CornerScatter out;
  Products narrow, wide;
  double square = 0;
  Lasting in_px;
  for (const std::vector<CornerError>& run : runs) {
    Visits visits(narrow, wide);
    std::map<int, const CornerError*> last;
    for (const CornerError& error : run) {
      if (is_misread(error)) continue;
      ++out.sightings;
      square += error.off_px.squaredNorm();
      out.chi_square += error.off_px.squaredNorm() / (8 * error.sigma_px * error.sigma_px);
      const CornerError*& before = last[error.tag_id];
      if (before != nullptr && to_seconds(error.at - before->at) < kNext_s)
        in_px.add(before->off_px, error.off_px);
      before = &error;
      visits.add(error);
    }
  }
  out.rms_px = std::sqrt(square / (8.0 * out.sightings));
  out.chi_square /= out.sightings;
  if (!std::isfinite(out.chi_square)) out.chi_square = std::nan("");
  out.to_next = in_px.correlation();
  out.fades_s = fading_time(narrow, wide);
  out.narrow = share_of(narrow, out.fades_s);
  out.wide = share_of(wide, out.fades_s);
  const double lasting =
      narrow.sightings * out.narrow.lasting.trace() + wide.sightings * out.wide.lasting.trace();
  const double passing =
      narrow.sightings * out.narrow.passing.trace() + wide.sightings * out.wide.passing.trace();
  out.lasting_share = lasting / (lasting + passing);
  return out;
}

BoundRun white_bound(const EstimationData& data, KnowledgeCase knowledge,
                     const CornerScatter& scatter) {
  const auto noise = [&](const CornerFrame& image, const TagSighting& tag) {
    const double sigma_px = scatter.excess() * corner_sigma_px(tag, image.pixel_noise);
    return bound::TagSight{.tag_id = tag.tag_id, .whiten = Matrix8::Identity() / sigma_px};
  };
  return run_bound(data, knowledge, noise, std::nullopt);
}

BoundRun scatter_bound(const EstimationData& data, KnowledgeCase knowledge,
                       const CornerScatter& scatter) {
  struct Roots {
    Matrix8 whiten, lasting;
    explicit Roots(const ScatterShare& of)
        : whiten(root_of(of.passing).inverse()), lasting(whiten * root_of(of.lasting)) {}
  };
  const Roots narrow(scatter.narrow);
  const Roots wide(scatter.wide);
  const auto noise = [&](const CornerFrame& image, const TagSighting& tag) {
    const bool is_narrow =
        outline_of(tag.corners_px).width_px < CornerScatter::kNarrow_px * kModules;
    const Roots& roots = is_narrow ? narrow : wide;
    const Matrix8 in_sigmas = outwards(tag.corners_px) / corner_sigma_px(tag, image.pixel_noise);
    return bound::TagSight{tag.tag_id, roots.whiten * in_sigmas, roots.lasting};
  };
  return run_bound(data, knowledge, noise, bound::LastingErrors{.fades_s = scatter.fades_s});
}

}  // namespace fiducap
