#include "estimation/filter/stacked_update.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "estimation/filter/kalman_gain.hpp"

namespace fiducap {

namespace {

constexpr int kRows = 8;
constexpr int kTurnedRows = 6;

constexpr Eigen::Index rows_of(const TagMeasurement& m) { return m.relative ? kTurnedRows : kRows; }

/// Turns (H, y) by Householder reflections until H is upper triangular. Whole columns, of which the
/// part above the diagonal is left out by zeros: of fixed size that is quicker than leaving it out.
void triangularise(Matrix86d& H, Vector8d& y) {
  for (Eigen::Index c = 0; c < H.cols(); ++c) {
    Vector8d axis = H.col(c);
    for (Eigen::Index above = 0; above < c; ++above) axis(above) = 0;
    const double norm = axis.norm();
    const double diagonal = axis(c) < 0 ? norm : -norm;
    axis(c) -= diagonal;
    const double scale = axis.squaredNorm();
    if (scale == 0) continue;
    const Vector8d scaled = (2 / scale) * axis;
    for (Eigen::Index k = c + 1; k < H.cols(); ++k) H.col(k) -= scaled.dot(H.col(k)) * axis;
    y -= scaled.dot(y) * axis;
    H(c, c) = diagonal;
  }
}

}  // namespace

void StackedUpdate::prepare(ConstCovariance P, const ImageMeasurement& image) {
  n_ = P.rows();
  if (shared_.rows() < n_) shared_.resize(n_ + n_ / 2, 6);
  auto shared = shared_.topRows(n_);
  shared.setZero();
  shared_own_.setZero();
  const auto terms = std::span(image.shared.terms).first(image.shared.term_count);
  for (const LinearTerm& term : terms)
    shared += P.middleCols<3>(term.at).lazyProduct(term.J.transpose());
  for (const LinearTerm& term : terms)
    shared_own_.noalias() += term.J * shared.middleRows<3>(term.at);

  turned_.resize(image.tags.size());
  for (std::size_t i = 0; i < image.tags.size(); ++i) {
    const TagMeasurement& m = image.tags[i];
    if (!m.relative || !m.in_front) continue;
    Matrix86d H = m.H;
    Vector8d y = m.y;
    triangularise(H, y);
    turned_[i].H = H.topRows<6>().triangularView<Eigen::Upper>();
    turned_[i].y = y.head<6>();
    turned_[i].rest_square = y.tail<2>().squaredNorm() / (m.noise_px * m.noise_px);
  }
}

void StackedUpdate::gate(ConstCovariance P, const ImageMeasurement& image, double limit,
                         std::vector<bool>& accepted) {
  used_.clear();
  accepted.assign(image.tags.size(), false);
  judged_.assign(image.tags.size(), {std::numeric_limits<double>::quiet_NaN(), 0.0});
  for (std::size_t i = 0; i < image.tags.size(); ++i) {
    const TagMeasurement& m = image.tags[i];
    if (!m.in_front) continue;
    judged_[i] = m.relative ? judge(P, m, turned_[i]) : judge(P, m);
    if (!(judged_[i].distance < limit)) continue;  // NaN stays out as well
    accepted[i] = true;
    used_.push_back(i);
  }
}

StackedUpdate::Judged StackedUpdate::judge(ConstCovariance P, const TagMeasurement& m,
                                           const Turned& turned) const {
  Matrix6d apart = shared_own_;
  if (m.own != TagMeasurement::kGiven) {
    const Matrix6d cross = shared_.middleRows<6>(m.own);
    apart += P.block<6, 6>(m.own, m.own) - cross - cross.transpose();
  }
  const double noise = m.noise_px * m.noise_px;
  Matrix6d S = turned.H * apart * turned.H.transpose();
  S.diagonal().array() += noise;
  const Eigen::LLT<Matrix6d> llt(S);
  if (llt.info() != Eigen::Success) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const double distance = llt.matrixL().solve(turned.y).squaredNorm() + turned.rest_square;
  return {distance, kRows * noise / (S.trace() + (kRows - kTurnedRows) * noise)};
}

StackedUpdate::Judged StackedUpdate::judge(ConstCovariance P, const TagMeasurement& m) const {
  Matrix8d S = m.R;
  for (std::size_t a = 0; a < m.block_count; ++a) {
    for (std::size_t b = 0; b < m.block_count; ++b) {
      S.noalias() +=
          m.blocks[a].H * P.block<3, 3>(m.blocks[a].at, m.blocks[b].at) * m.blocks[b].H.transpose();
    }
  }
  return {m.y.dot(S.ldlt().solve(m.y)), m.R.trace() / S.trace()};
}

void StackedUpdate::reserve(Eigen::Index rows) {
  if (PHt_.rows() >= n_ && PHt_.cols() >= rows) return;
  PHt_.resize(n_ + n_ / 2, rows * 2);
  shared_PHt_.resize(6, rows * 2);
  S_.resize(rows * 2, rows * 2);
  y_.resize(rows * 2);
  dx_.resize(n_ + n_ / 2);
}

void StackedUpdate::stack(ConstCovariance P, const ImageMeasurement& image) {
  rows_ = 0;
  for (const std::size_t i : used_) rows_ += rows_of(image.tags[i]);
  reserve(rows_);
  Eigen::Index at = 0;
  for (const std::size_t i : used_) {
    const TagMeasurement& m = image.tags[i];
    m.relative ? stack_gain(P, m, turned_[i], at) : stack_gain(P, m, at);
    at += rows_of(m);
  }
  for (Eigen::Index k = 0; k < rows_; ++k) {
    Vector6d of_shared = Vector6d::Zero();
    for (std::size_t t = 0; t < image.shared.term_count; ++t) {
      of_shared.noalias() +=
          image.shared.terms[t].J * PHt_.col(k).segment<3>(image.shared.terms[t].at);
    }
    shared_PHt_.col(k) = of_shared;
  }
  at = 0;
  for (const std::size_t i : used_) {
    const TagMeasurement& m = image.tags[i];
    m.relative ? stack_scatter(m, turned_[i], at) : stack_scatter(m, at);
    at += rows_of(m);
  }
}

void StackedUpdate::stack_gain(ConstCovariance P, const TagMeasurement& m, const Turned& turned,
                               Eigen::Index at) {
  y_.segment<kTurnedRows>(at) = turned.y;
  const double* const own = m.own == TagMeasurement::kGiven ? nullptr : P.col(m.own).data();
  dense::multiply_difference({own, P.outerStride()}, kalman::view_of(shared_),
                             {turned.H.data(), kTurnedRows},
                             {PHt_.col(at).data(), PHt_.outerStride()}, n_);
}

void StackedUpdate::stack_gain(ConstCovariance P, const TagMeasurement& m, Eigen::Index at) {
  y_.segment<kRows>(at) = m.y;
  auto PHt = PHt_.middleCols<kRows>(at).topRows(n_);
  PHt.setZero();
  for (std::size_t b = 0; b < m.block_count; ++b) {
    PHt.noalias() += P.middleCols<3>(m.blocks[b].at) * m.blocks[b].H.transpose();
  }
}

void StackedUpdate::stack_scatter(const TagMeasurement& m, const Turned& turned, Eigen::Index at) {
  for (Eigen::Index k = 0; k < at + kTurnedRows; ++k) {
    Vector6d apart = -shared_PHt_.col(k);
    if (m.own != TagMeasurement::kGiven) apart += PHt_.col(k).segment<kTurnedRows>(m.own);
    S_.col(k).segment<kTurnedRows>(at).noalias() = turned.H * apart;
  }
  S_.diagonal().segment<kTurnedRows>(at).array() += m.noise_px * m.noise_px;
}

void StackedUpdate::stack_scatter(const TagMeasurement& m, Eigen::Index at) {
  auto S = S_.block(at, 0, kRows, at + kRows);
  S.setZero();
  for (std::size_t b = 0; b < m.block_count; ++b) {
    S.noalias() += m.blocks[b].H * PHt_.middleRows<3>(m.blocks[b].at).leftCols(at + kRows);
  }
  S.rightCols<kRows>() += m.R;
}

double StackedUpdate::solve(ConstCovariance P, const ImageMeasurement& image,
                            std::span<const int> held) {
  stack(P, image);
  double rest = 0;
  for (const std::size_t i : used_) rest += image.tags[i].relative ? turned_[i].rest_square : 0;
  return rest + kalman::solve(PHt_.topLeftCorner(n_, rows_), S_.topLeftCorner(rows_, rows_),
                              y_.head(rows_), held, dx_.head(n_));
}

void StackedUpdate::shrink(Covariance P, std::span<const int> held) {
  kalman::shrink(P, PHt_.topLeftCorner(n_, rows_), held, held_mask_);
}

double StackedUpdate::rms_px(const ImageMeasurement& image) const {
  double squares = 0;
  for (const std::size_t i : used_) squares += image.tags[i].y.squaredNorm();
  return std::sqrt(squares / (4.0 * static_cast<double>(used_.size())));
}

}  // namespace fiducap
