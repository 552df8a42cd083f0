#include "estimation/stacked_update.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "estimation/kalman_gain.hpp"

namespace fiducap {

namespace {
constexpr int kRows = 8;
}  // namespace

void StackedUpdate::gate(ConstCovariance P, std::span<const TagMeasurement> measurements, double limit,
                         std::vector<bool>& accepted) {
  used_.clear();
  accepted.assign(measurements.size(), false);
  judged_.assign(measurements.size(), {std::numeric_limits<double>::quiet_NaN(), 0.0});
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    const TagMeasurement& m = measurements[i];
    if (!m.in_front) continue;
    Matrix8d S = m.R;
    for (std::size_t a = 0; a < m.block_count; ++a) {
      for (std::size_t b = 0; b < m.block_count; ++b) {
        S.noalias() += m.blocks[a].H * P.block<3, 3>(m.blocks[a].at, m.blocks[b].at) * m.blocks[b].H.transpose();
      }
    }
    const double distance = m.y.dot(S.ldlt().solve(m.y));
    judged_[i] = {distance, m.R.trace() / S.trace()};
    if (!(distance < limit)) continue;  // NaN stays out as well
    accepted[i] = true;
    used_.push_back(i);
  }
}

void StackedUpdate::stack(ConstCovariance P, std::span<const TagMeasurement> measurements) {
  n_ = P.rows();
  const Eigen::Index rows = kRows * static_cast<Eigen::Index>(used_.size());
  if (PHt_.rows() < n_ || PHt_.cols() < rows) {
    PHt_.resize(n_ + n_ / 2, rows * 2);
    S_.resize(rows * 2, rows * 2);
    y_.resize(rows * 2);
    dx_.resize(n_ + n_ / 2);
  }
  auto PHt = PHt_.topLeftCorner(n_, rows);
  auto S = S_.topLeftCorner(rows, rows);
  PHt.setZero();
  for (std::size_t k = 0; k < used_.size(); ++k) {
    const TagMeasurement& m = measurements[used_[k]];
    const Eigen::Index at = kRows * static_cast<Eigen::Index>(k);
    y_.segment<kRows>(at) = m.y;
    for (std::size_t b = 0; b < m.block_count; ++b) {
      PHt.middleCols<kRows>(at).noalias() += P.middleCols<3>(m.blocks[b].at) * m.blocks[b].H.transpose();
    }
  }
  for (std::size_t k = 0; k < used_.size(); ++k) {
    const TagMeasurement& m = measurements[used_[k]];
    const Eigen::Index at = kRows * static_cast<Eigen::Index>(k);
    S.middleRows<kRows>(at).setZero();
    for (std::size_t b = 0; b < m.block_count; ++b) {
      S.middleRows<kRows>(at).noalias() += m.blocks[b].H * PHt.middleRows<3>(m.blocks[b].at);
    }
    S.block<kRows, kRows>(at, at) += m.R;
  }
}

double StackedUpdate::solve(ConstCovariance P, std::span<const TagMeasurement> measurements,
                            std::span<const int> held) {
  stack(P, measurements);
  return kalman::solve(PHt_.topLeftCorner(n_, rows()), S_.topLeftCorner(rows(), rows()), y_.head(rows()), held, dx_.head(n_));
}

void StackedUpdate::shrink(Covariance P, std::span<const int> held) const {
  kalman::shrink(P, PHt_.topLeftCorner(n_, rows()), held);
}

double StackedUpdate::rms_px(std::span<const TagMeasurement> measurements) const {
  double squares = 0;
  for (const std::size_t i : used_) squares += measurements[i].y.squaredNorm();
  return std::sqrt(squares / (4.0 * static_cast<double>(used_.size())));
}

}  // namespace fiducap
