#include "pipeline/correction_ramp.hpp"

#include <algorithm>
#include <cmath>

#include "base/so3.hpp"

namespace fiducap {

namespace {

using Eigen::Vector3d;
using Part = CorrectionRamp::Part;

// 2 · 3^¼ / ½: half a sigma per frame, and an axis holds a third of a square at least.
constexpr double kFramesPerRoot = 5.26;
constexpr double kStrayShare = 0.25;  // of a sigma per frame
// Nobody looks closer: a sigma of zero would take forever.
constexpr double kLeastSigma = 1e-5;

/// The largest axis' of a block.
double sigma_of(const BodyEstimate& estimate, int block) {
  return std::max(kLeastSigma,
                  std::sqrt(estimate.covariance.diagonal().segment<3>(block).maxCoeff()));
}

/// How much of the speed leads to zero; 1: all that is needed for it within the time.
double onward_share(const Part& part, double seconds) {
  const double square = part.rest.squaredNorm();
  if (square == 0) return 0;
  return std::clamp(-part.speed.dot(part.rest) * seconds / (2 * square), 0.0, 1.0);
}

/// So that no frame moves by more than half a sigma.
double seconds_needed(const Part& part, double seconds, double sigma, double frame_s) {
  const double standing = 1 + 2 * (1 - onward_share(part, seconds));
  return kFramesPerRoot * frame_s * std::sqrt(standing * part.rest.norm() / sigma);
}

/// The speed with no more than a share of a sigma per frame beside what leads to zero.
Vector3d limited_speed(const Part& part, double seconds, double sigma, double frame_s) {
  const Vector3d onward = -2 * onward_share(part, seconds) / seconds * part.rest;
  const Vector3d stray = part.speed - onward;
  const double most = kStrayShare * sigma / frame_s;
  return stray.norm() > most ? Vector3d(onward + most * stray.normalized()) : part.speed;
}

}  // namespace

bool CorrectionRamp::is_over(Instant at) const {
  return to_seconds(at - begun_at_) >= seconds_;
}

/// @pre !is_over(at)
Part CorrectionRamp::at(const Part& begin, Instant at) const {
  const double u = std::max(0.0, to_seconds(at - begun_at_) / seconds_);
  const double left = 1 - u;
  return {left * left * ((1 + 2 * u) * begin.rest + u * seconds_ * begin.speed),
          left * ((1 - 3 * u) * begin.speed - 6 * u / seconds_ * begin.rest)};
}

void CorrectionRamp::add(const Pose& X_new_old, const BodyEstimate& now, Instant from) {
  if (config_.seconds <= 0) return;
  Part place;
  Part turn;
  if (!is_over(from)) {
    from = std::max(from, begun_at_);
    place = at(place_, from);
    turn = at(turn_, from);
  }
  const Pose X_old_new = X_new_old.inverse();
  place.rest += X_old_new * now.X_WB.p - now.X_WB.p;
  turn.rest = log_so3((exp_so3(turn.rest) * X_old_new.q).normalized());
  plan(place, turn, config_.seconds, now, from);
}

void CorrectionRamp::follow(const BodyEstimate& now, Instant from) {
  if (is_over(from)) return;
  from = std::max(from, begun_at_);
  const double left_s = seconds_ - to_seconds(from - begun_at_);
  plan(at(place_, from), at(turn_, from), left_s, now, from);
}

void CorrectionRamp::plan(Part place, Part turn, double seconds, const BodyEstimate& now,
                          Instant from) {
  const double place_sigma = sigma_of(now, estimate_block::kPosition);
  const double turn_sigma = sigma_of(now, estimate_block::kAttitude);
  seconds_ = std::max({seconds, seconds_needed(place, seconds, place_sigma, config_.frame_s),
                       seconds_needed(turn, seconds, turn_sigma, config_.frame_s)});
  place.speed = limited_speed(place, seconds_, place_sigma, config_.frame_s);
  turn.speed = limited_speed(turn, seconds_, turn_sigma, config_.frame_s);
  place_ = place;
  turn_ = turn;
  begun_at_ = from;
  const bool is_number = std::isfinite(seconds_) && place.rest.allFinite() && turn.rest.allFinite();
  if (!is_number) forget();
}

void CorrectionRamp::apply(Instant at, BodyEstimate& shown) const {
  if (is_over(at)) return;
  const Part place = this->at(place_, at);
  const Part turn = this->at(turn_, at);
  shown.X_WB.p += place.rest;
  shown.X_WB.q = (exp_so3(turn.rest) * shown.X_WB.q).normalized();
  // The error of what is shown is the filter's and this.
  Eigen::Matrix<double, 6, 1> rest;
  rest << place.rest, turn.rest;
  shown.covariance.topLeftCorner<6, 6>() += rest * rest.transpose();
}

}  // namespace fiducap
