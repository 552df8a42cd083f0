#include "simulation/corner_scatter.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "detection/observe.hpp"

namespace fiducap {

namespace {

constexpr double kMisread_px = 1.0;
constexpr double kMisreadSigmas = 10.0;
// Images further apart than this are no neighbours.
constexpr double kNext_s = 0.15;

bool is_misread(const CornerError& error) {
  return error.off_px.cwiseAbs().maxCoeff() >
         std::max(kMisread_px, kMisreadSigmas * error.sigma_px);
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
      out.push_back({image->exposed_at, tag.tag_id, residual.y, tag.corner_sigma_px});
    }
  }
  return out;
}

double CornerScatter::excess() const { return std::sqrt(chi_square); }

double CornerScatter::lasting_excess() const {
  const double rho = std::max(0.0, lasting_in_sigmas);
  return excess() * std::sqrt((1 + rho) / (1 - rho));
}

CornerScatter corner_scatter(const std::vector<CornerError>& errors) {
  CornerScatter out;
  std::map<int, const CornerError*> before;
  double square = 0;
  Lasting in_px;
  Lasting in_sigmas;
  for (const CornerError& error : errors) {
    if (is_misread(error)) continue;
    ++out.sightings;
    square += error.off_px.squaredNorm();
    out.chi_square += error.off_px.squaredNorm() / (8 * error.sigma_px * error.sigma_px);
    const CornerError*& last = before[error.tag_id];
    if (last != nullptr && to_seconds(error.at - last->at) < kNext_s) {
      in_px.add(last->off_px, error.off_px);
      in_sigmas.add(last->off_px / last->sigma_px, error.off_px / error.sigma_px);
    }
    last = &error;
  }
  out.rms_px = std::sqrt(square / (8.0 * out.sightings));
  out.chi_square /= out.sightings;
  if (!std::isfinite(out.chi_square)) out.chi_square = std::nan("");
  out.lasting = in_px.correlation();
  out.lasting_in_sigmas = in_sigmas.correlation();
  return out;
}

}  // namespace fiducap
