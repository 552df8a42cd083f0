#include "pipeline/map_corrections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/so3.hpp"

namespace fiducap {

namespace {

constexpr double kMm = 1e3;
constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kWorthSaying_m = 0.01;
constexpr double kWorthSaying_rad = 0.5 / kDegrees;

bool is_worth_saying(const Eigen::Vector3d& moved, double least, const BodyEstimate& estimate,
                     int block) {
  const double variance = estimate.covariance.diagonal().segment<3>(block).maxCoeff();
  return moved.norm() > std::max(least, std::sqrt(variance));
}

}  // namespace

std::string MapCorrections::add(const UpdateReport& report,
                                const std::optional<BodyEstimate>& estimate) {
  const bool goes_on = estimate && estimate->anchored && report.generation == generation_;
  generation_ = report.generation;
  if (!goes_on) {
    place_.setZero();
    turn_.setZero();
    return {};
  }
  if (!report.map_shift) return {};
  place_ += estimate->X_WB.p - report.map_shift->inverse() * estimate->X_WB.p;
  turn_ += log_so3(report.map_shift->q);
  if (!is_worth_saying(place_, kWorthSaying_m, *estimate, estimate_block::kPosition) &&
      !is_worth_saying(turn_, kWorthSaying_rad, *estimate, estimate_block::kAttitude))
    return {};
  std::string text =
      fmt::format("the map has learned that it stands elsewhere, by {:.0f} mm and {:.2f} degrees",
                  kMm * place_.norm(), kDegrees * turn_.norm());
  place_.setZero();
  turn_.setZero();
  return text;
}

}  // namespace fiducap
