#include "pipeline/correction_ramp.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/numeric.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using Part = CorrectionRamp::Part;

// 2 · 3^¼ / ½: half a sigma per frame, and an axis holds a third of a square at least.
constexpr double kFramesPerRoot = 5.26;
constexpr double kStrayShare = 0.25;  // of a sigma per frame
constexpr double kAtOnce = 0.25;      // of a sigma; with the two above: one
// A sigma of zero would take forever.
constexpr double kLeastSigma = 1e-5;

/// Of the largest axis of a block.
double sigma_of(const BodyEstimate& estimate, int block) {
  return std::max(kLeastSigma,
                  std::sqrt(estimate.covariance.diagonal().segment<3>(block).maxCoeff()));
}

/// Share of the speed that leads to zero within the time; 1: as much as needed.
double onward_share(const Part& part, double seconds) {
  const double square = part.rest.squaredNorm();
  if (square == 0) return 0;
  return std::clamp(-part.speed.dot(part.rest) * seconds / (2 * square), 0.0, 1.0);
}

/// For at most half a sigma per frame.
double seconds_needed(const Part& part, double seconds, double sigma, double frame_s) {
  const double standing = 1 + 2 * (1 - onward_share(part, seconds));
  return kFramesPerRoot * frame_s * std::sqrt(standing * part.rest.norm() / sigma);
}

/// Limits the speed that does not lead to zero to a share of a sigma per frame.
void limit_speed(Part& part, double seconds, double sigma, double frame_s) {
  const Vector3d onward = -2 * onward_share(part, seconds) / seconds * part.rest;
  const Vector3d stray = part.speed - onward;
  const double most = kStrayShare * sigma / frame_s;
  if (stray.norm() > most) part.speed = onward + most * stray.normalized();
}

/// @param u  share of the time that is over
Part part_at(const Part& begin, double seconds, double u) {
  const double left = 1 - u;
  return {left * left * ((1 + 2 * u) * begin.rest + u * seconds * begin.speed),
          left * ((1 - 3 * u) * begin.speed - 6 * u / seconds * begin.rest)};
}

constexpr double kMm = 1e3;
constexpr double kReported_m = 0.01;
constexpr double kReported_rad = 0.5 / kDegreesPerRadian;

bool is_reportable(const Eigen::Vector3d& moved, double least, const BodyEstimate& estimate,
                   int block) {
  return moved.norm() > std::max(least, sigma_of(estimate, block));
}

}  // namespace

bool CorrectionRamp::is_over(Instant at) const { return to_seconds(at - begun_at_) >= seconds_; }

/// Zero when it is over.
CorrectionRamp::Rest CorrectionRamp::at(Instant at) const {
  if (is_over(at)) return {};
  const double u = std::max(0.0, to_seconds(at - begun_at_) / seconds_);
  return {part_at(begin_.place, seconds_, u), part_at(begin_.turn, seconds_, u)};
}

void CorrectionRamp::correct(const Pose& shown, const BodyEstimate& now, Instant from) {
  from = std::max(from, begun_at_);
  Rest rest = at(from);
  rest.place.rest = shown.p - now.X_WB.p;
  rest.turn.rest = log_so3(shown.q * now.X_WB.q.conjugate());
  plan(rest, config_.seconds, now, from);
}

void CorrectionRamp::follow(const Pose& shown, const BodyEstimate& now, Instant from) {
  from = std::max(from, begun_at_);
  Rest rest = at(from);
  const Vector3d place = shown.p - now.X_WB.p;
  const Vector3d turn = log_so3(shown.q * now.X_WB.q.conjugate());
  const bool is_step =
      (place - rest.place.rest).norm() > kAtOnce * sigma_of(now, estimate_block::kPosition) ||
      (turn - rest.turn.rest).norm() > kAtOnce * sigma_of(now, estimate_block::kAttitude);
  if (is_step) {
    rest.place.rest = place;
    rest.turn.rest = turn;
  } else if (is_over(from)) {
    return;
  }
  plan(rest, std::max(0.0, seconds_ - to_seconds(from - begun_at_)), now, from);
}

void CorrectionRamp::plan(Rest rest, double seconds, const BodyEstimate& now, Instant from) {
  if (!rest.place.rest.allFinite() || !rest.turn.rest.allFinite()) return forget();
  const double place_sigma = sigma_of(now, estimate_block::kPosition);
  const double turn_sigma = sigma_of(now, estimate_block::kAttitude);
  seconds_ = std::max({seconds, seconds_needed(rest.place, seconds, place_sigma, config_.frame_s),
                       seconds_needed(rest.turn, seconds, turn_sigma, config_.frame_s)});
  if (seconds_ <= 0) return;  // nothing is left
  limit_speed(rest.place, seconds_, place_sigma, config_.frame_s);
  limit_speed(rest.turn, seconds_, turn_sigma, config_.frame_s);
  begin_ = rest;
  begun_at_ = from;
}

void CorrectionRamp::apply(Instant at, BodyEstimate& shown) const {
  if (is_over(at)) return;
  const Rest left = this->at(at);
  shown.X_WB.p += left.place.rest;
  shown.X_WB.q = (exp_so3(left.turn.rest) * shown.X_WB.q).normalized();
  // The published error is the filter's plus the rest.
  Eigen::Matrix<double, 6, 1> rest;
  rest << left.place.rest, left.turn.rest;
  shown.covariance.topLeftCorner<6, 6>() += rest * rest.transpose();
}

std::string MapCorrections::add(const UpdateReport& report,
                                const std::optional<BodyEstimate>& estimate) {
  const bool continues = estimate && estimate->anchored && report.generation == generation_;
  generation_ = report.generation;
  if (!continues) {
    place_.setZero();
    turn_.setZero();
    return {};
  }
  if (!report.map_shift) return {};
  place_ += estimate->X_WB.p - report.map_shift->inverse() * estimate->X_WB.p;
  turn_ += log_so3(report.map_shift->q);
  if (!is_reportable(place_, kReported_m, *estimate, estimate_block::kPosition) &&
      !is_reportable(turn_, kReported_rad, *estimate, estimate_block::kAttitude))
    return {};
  std::string text =
      fmt::format("a correction of the map has moved it by {:.0f} mm and {:.2f} degrees",
                  kMm * place_.norm(), kDegreesPerRadian * turn_.norm());
  place_.setZero();
  turn_.setZero();
  return text;
}

}  // namespace fiducap
