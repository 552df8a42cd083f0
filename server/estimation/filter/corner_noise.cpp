#include "estimation/filter/corner_noise.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/filter/chi_square.hpp"

namespace fiducap {

namespace {
constexpr double kMedian = 7.344;  // of chi-square with 8 degrees of freedom
// Step of log f per sighting: large while distances are on one side of their median, then small
// enough that f varies by 2 %.
constexpr double kFirstStep = 0.03;
constexpr double kLastStep = 0.003;
constexpr double kStepShrinks = 0.985;
constexpr double kSideMemory = 0.05;
constexpr double kOneSided = 0.5;
// Factor of the downward step with fall_quickly(): f can fall by two decades.
constexpr double kFallsQuickly = 4;
// Errors of lens model and print are not white and do not average out. On rendered images 1 to 5 %
// of a coordinate's variance persist while a tag is in view: 0.003 px of 0.012 px of a sharp tag.
constexpr double kLeast_px = 0.004;
constexpr double kMost = 20.0;
// Probability of a smaller chi-square of the views of a new tag by the assumed noise.
constexpr double kNoisyViews = 0.999;
// Larger errors of them are not noise.
constexpr double kMostByViews = 5.0;
// A movement of this size makes the detector's error on the pixel grid independent.
constexpr double kMoved_px = 1.0;
// Largest noise factor of repeated sightings: they still show that the body did not move.
constexpr int kMostRepeated = 8;
// Correlation length of the lens error, in image widths.
constexpr double kLensReach = 0.2;
// Factor of the lens error: it is equal for successive tags and accumulates along a path where it
// is treated as noise (docs/design/corner-noise.md).
constexpr double kLensLasts = 2;

Eigen::Vector2d middle_of(const std::array<Eigen::Vector2d, 4>& px) {
  return 0.25 * (px[0] + px[1] + px[2] + px[3]);
}
}  // namespace

CornerNoise::CornerNoise(const EstimatorConfig& config, bool learns, const CameraMount* lens)
    : start_px_(config.corner_noise_px),
      begun_px_(config.corner_noise_px),
      unexplained_px_(config.corner_noise_px),
      least_px_(config.corner_noise_px),
      step_(kFirstStep),
      learns_(learns) {
  if (lens == nullptr || lens->model.width <= 0) return;
  lens_error_px_ = kLensLasts * lens->lens_error_px;
  lens_reach_px_ = kLensReach * lens->model.width;
}

/// Noise factor of the next sighting at one place.
double CornerNoise::repeated(const TagObservation& seen) const {
  const Place& place = places_[static_cast<std::size_t>(seen.tag_id) % kPlaces];
  const bool is_there = seen.knows_sides() && place.tag_id == seen.tag_id &&
                        (middle_of(seen.corners_px) - place.px).norm() < kMoved_px;
  return is_there ? std::min(place.looks + 1, kMostRepeated) : 1.0;
}

/// Lens error of the next sighting in one part of the image, px.
double CornerNoise::lens_px(const TagObservation& seen) const {
  const Place& place = places_[static_cast<std::size_t>(seen.tag_id) % kPlaces];
  const bool is_there = place.tag_id == seen.tag_id &&
                        (middle_of(seen.raw_px) - place.part_px).norm() < lens_reach_px_;
  return lens_error_px_ * (is_there ? std::min(place.part_looks + 1, kMostRepeated) : 1);
}

double CornerNoise::of(const TagObservation& seen) const {
  if (!learns_) return start_px_;
  return std::hypot(repeated(seen) * std::hypot(seen.corner_sigma_px, unexplained_px_),
                    lens_px(seen));
}

Matrix8d CornerNoise::covariance(const TagObservation& seen, double more_px) const {
  Matrix8d R = Matrix8d::Zero();
  if (seen.knows_sides()) {
    R = corner_covariance(seen.raw_px, seen.sides);
  } else {
    R.diagonal().array() = seen.corner_sigma_px * seen.corner_sigma_px;
  }
  R.diagonal().array() += unexplained_px_ * unexplained_px_;
  const double times = repeated(seen);
  R *= times * times;
  // The lens error is correlated between near corners.
  const double px = lens_px(seen);
  for (int i = 0; lens_error_px_ > 0 && i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      const double apart =
          (seen.raw_px[static_cast<std::size_t>(i)] - seen.raw_px[static_cast<std::size_t>(j)])
              .norm() /
          lens_reach_px_;
      R.block<2, 2>(2 * i, 2 * j).diagonal().array() += px * px * std::exp(-0.5 * apart * apart);
    }
  }
  R.diagonal().array() += more_px * more_px;
  return R;
}

void CornerNoise::begin_with(double unexplained_px) {
  begun_px_ = unexplained_px_ = least_px_ = std::min(unexplained_px, start_px_);
}

void CornerNoise::learn_from_views(const TagObservation& seen, double cost,
                                   int degrees_of_freedom) {
  if (!learns_ || degrees_of_freedom <= 0) return;
  if (!(cost > chi_square_quantile(degrees_of_freedom, kNoisyViews))) return;
  const double noise_px = std::max(of(seen), start_px_);
  const double variance = noise_px * noise_px * cost / degrees_of_freedom;
  const double rest = variance - seen.corner_sigma_px * seen.corner_sigma_px;
  const double most = kMostByViews * start_px_;
  if (rest > unexplained_px_ * unexplained_px_ && rest < most * most)
    unexplained_px_ = std::sqrt(rest);
}

double CornerNoise::growth(const TagObservation& seen) const {
  if (!learns_) return 1;
  return std::hypot(seen.corner_sigma_px, unexplained_px_) /
         std::hypot(seen.corner_sigma_px, begun_px_);
}

bool CornerNoise::has_moved(const TagObservation& seen) {
  Place& place = places_[static_cast<std::size_t>(seen.tag_id) % kPlaces];
  const Eigen::Vector2d now = middle_of(seen.corners_px);
  const bool is_same = place.tag_id == seen.tag_id;
  const Eigen::Vector2d raw = middle_of(seen.raw_px);
  if (!is_same || (raw - place.part_px).norm() > lens_reach_px_) {
    place.part_px = raw;
    place.part_looks = 0;
  }
  ++place.part_looks;
  if (is_same && (now - place.px).norm() < kMoved_px) {
    ++place.looks;
    return false;
  }
  place = {seen.tag_id, now, 1, place.part_px, place.part_looks};
  return is_same;
}

void CornerNoise::learn(const TagObservation& seen, double distance, double share) {
  if (!learns_ || !(share > 0) || std::isnan(distance)) return;
  const double side = distance > kMedian ? 1 : -1;
  const bool falls = falls_quickly_ && seen.knows_sides() && one_sided_ < -kOneSided && side < 0;
  unexplained_px_ *= std::exp(side * (falls ? kFallsQuickly : 1) * step_ * share);
  const bool moved = has_moved(seen);
  const double least_px = moved ? std::min(kLeast_px, start_px_) : least_px_;
  unexplained_px_ = std::clamp(unexplained_px_, least_px, kMost * start_px_);
  if (moved) least_px_ = unexplained_px_;
  one_sided_ += kSideMemory * (side - one_sided_);
  step_ = std::abs(one_sided_) > kOneSided ? std::min(kFirstStep, step_ / kStepShrinks)
                                           : std::max(kLastStep, step_ * kStepShrinks);
}

}  // namespace fiducap
