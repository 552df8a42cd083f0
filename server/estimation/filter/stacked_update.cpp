#include "estimation/filter/stacked_update.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "estimation/filter/dense_kernels.hpp"
#include "estimation/filter/kalman_gain.hpp"

namespace fiducap {

namespace {
constexpr int kRows = 8;
constexpr int kTurnedRows = 6;
// Share of the corner noise in the innovation of a tag whose corners are predicted to 3 sigmas of
// it.
constexpr double kPredicted = 0.1;

constexpr Eigen::Index rows_of(const TagMeasurement& m) { return m.relative ? kTurnedRows : kRows; }

/// Makes H upper triangular by Householder reflections, applied to y as well. Works on whole
/// columns with zeros above the diagonal: a fixed size is faster than a shorter column.
/// @param y  8 × k
template <class Rest>
void triangularise(Matrix86d& H, Rest& y) {
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
    for (Eigen::Index k = 0; k < y.cols(); ++k) y.col(k) -= scaled.dot(y.col(k)) * axis;
    H(c, c) = diagonal;
  }
}

dense::ConstView columns_of(const StackedUpdate::ConstCovariance& P, Eigen::Index first) {
  return {P.col(first).data(), P.outerStride()};
}

/// Makes a corner so noisy that it does not count.
void remove_corner(int corner, TagMeasurement& m) {
  constexpr double kNoise_px = 1e3;
  if (m.even) m.R = m.noise_px * m.noise_px * Matrix8d::Identity();
  m.even = false;
  m.R.diagonal().segment<2>(2 * corner).array() += kNoise_px * kNoise_px;
}

/// Whitens by the Cholesky factor of the noise covariance.
template <class Rest>
void make_even(const Matrix8d& R, Matrix86d& H, Rest& y) {
  const Eigen::LLT<Matrix8d> root(R);
  FIDUCAP_ASSERT(root.info() == Eigen::Success);
  root.matrixL().solveInPlace(H);
  root.matrixL().solveInPlace(y);
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
    dense::add_product(columns_of(P, term.at), 3, {term.J.data(), kTurnedRows},
                       kalman::view_of(shared_), n_);
  for (const LinearTerm& term : terms)
    shared_own_.noalias() += term.J * shared.middleRows<3>(term.at);

  turned_.resize(image.tags.size());
  for (std::size_t i = 0; i < image.tags.size(); ++i) {
    const TagMeasurement& m = image.tags[i];
    if (!m.relative || !m.in_front) continue;
    turned_[i] = turn(m, image.parameters.are_there());
  }
}

StackedUpdate::Turned StackedUpdate::turn(const TagMeasurement& m, bool parameters) {
  Turned out;
  out.noise = m.even ? m.noise_px * m.noise_px : 1.0;
  Matrix86d H = m.H;
  Vector8d y = m.y;
  if (parameters) {
    Eigen::Matrix<double, 8, 1 + ParameterColumns::kAll> rest;
    rest << m.y, m.H_camera, m.H_size;
    if (!m.even) make_even(m.R, H, rest);
    triangularise(H, rest);
    y = rest.col(0);
    out.H_parameters = rest.topRightCorner<6, ParameterColumns::kAll>();
  } else {
    if (!m.even) make_even(m.R, H, y);
    triangularise(H, y);
  }
  out.H = H.topRows<6>().triangularView<Eigen::Upper>();
  out.y = y.head<6>();
  out.rest_square = y.tail<2>().squaredNorm() / out.noise;
  return out;
}

/// Without the corner that fits least.
StackedUpdate::Judged StackedUpdate::judge_three_corners(ConstCovariance P,
                                                         const ImageMeasurement& image,
                                                         const TagMeasurement& m) const {
  Judged best{std::numeric_limits<double>::infinity(), 0.0};
  for (int corner = 0; corner < 4; ++corner) {
    TagMeasurement other = m;
    remove_corner(corner, other);
    const bool parameters = image.parameters.are_there();
    Judged judged =
        m.relative ? judge(P, image, other, turn(other, parameters)) : judge(P, image, other);
    judged.outlier = corner;
    if (judged.distance < best.distance) best = judged;
  }
  return best;
}

void StackedUpdate::remove_outliers(ImageMeasurement& image) const {
  for (std::size_t i = 0; i < image.tags.size(); ++i)
    if (judged_[i].outlier >= 0) remove_corner(judged_[i].outlier, image.tags[i]);
}

int StackedUpdate::degrees_of_freedom() const {
  int sum = 0;
  for (const std::size_t i : used_) sum += judged_[i].outlier < 0 ? kRows : kRows - 2;
  return sum;
}

void StackedUpdate::gate(ConstCovariance P, ImageMeasurement& image, const GateLimits& limits,
                         std::vector<bool>& accepted) {
  used_.clear();
  accepted.assign(image.tags.size(), false);
  judged_.assign(image.tags.size(), {std::numeric_limits<double>::quiet_NaN(), 0.0});
  for (std::size_t i = 0; i < image.tags.size(); ++i) {
    TagMeasurement& m = image.tags[i];
    if (!m.in_front) continue;
    judged_[i] = m.relative ? judge(P, image, m, turned_[i]) : judge(P, image, m);
    if (!(judged_[i].distance < limits.of_tag)) {  // rejects NaN as well
      // With an uncertain prediction three corners fit any pose.
      if (!(judged_[i].noise_share > kPredicted)) continue;
      const Judged without = judge_three_corners(P, image, m);
      if (!(without.distance < limits.of_three_corners)) continue;
      judged_[i].distance = without.distance;
      judged_[i].outlier = without.outlier;
      remove_corner(without.outlier, m);
      if (m.relative) turned_[i] = turn(m, image.parameters.are_there());
    }
    accepted[i] = true;
    used_.push_back(i);
  }
}

StackedUpdate::SharedScore StackedUpdate::shared_score(const ImageMeasurement& image) {
  dense::divide(kalman::view_of(S_), rows_, kalman::view_of(shared_H_), shared_H_.rows());
  const auto H = shared_H_.topRows<6>().leftCols(rows_);
  SharedScore out;
  out.information.noalias() = H * H.transpose();
  out.score.noalias() = H * y_.head(rows_);
  out.by_known_tags.setZero();
  for (const std::size_t i : used_) {
    const TagMeasurement& m = image.tags[i];
    if (m.relative && !m.even) {
      out.by_known_tags += turned_[i].H.transpose().lazyProduct(turned_[i].H);
    } else {
      const Matrix86d whitened = m.H / m.noise_px;
      out.by_known_tags += whitened.transpose().lazyProduct(whitened);
    }
  }
  return out;
}

/// Adds the contribution of the calibration parameters to the covariance of a rotated measurement.
void StackedUpdate::add_parameters(ConstCovariance P, const ParameterColumns& parameters,
                                   const TagMeasurement& m, const Turned& turned,
                                   Matrix6d& S) const {
  // Columns: the camera's parameters, then the size of this tag.
  constexpr int kCamera = ParameterColumns::kOfCamera;
  constexpr int kSize = ParameterColumns::kOfCamera;  // the column after them
  const ParameterMatrix& H = turned.H_parameters;
  ParameterMatrix cross;  // with (own − shared)
  Eigen::Matrix<double, ParameterColumns::kAll, ParameterColumns::kAll> own;
  const int at = parameters.camera;
  const auto size_column = [&](Eigen::Index row) {
    return P(row, parameters.size) + (m.own_size < 0 ? 0.0 : P(row, m.own_size));
  };
  cross.leftCols<kCamera>() = -shared_.middleRows<kCamera>(at).transpose();
  cross.col(kSize) = -shared_.row(parameters.size).transpose();
  if (m.own_size >= 0) cross.col(kSize) -= shared_.row(m.own_size).transpose();
  if (m.own != TagMeasurement::kGiven) {
    cross.leftCols<kCamera>() += P.block<6, kCamera>(m.own, at);
    for (Eigen::Index k = 0; k < 6; ++k) cross(k, kSize) += size_column(m.own + k);
  }
  own.topLeftCorner<kCamera, kCamera>() = P.block<kCamera, kCamera>(at, at);
  for (Eigen::Index k = 0; k < kCamera; ++k) own(k, kSize) = own(kSize, k) = size_column(at + k);
  own(kSize, kSize) =
      size_column(parameters.size) + (m.own_size < 0 ? 0.0 : size_column(m.own_size));
  const Matrix6d mixed = turned.H * cross * H.transpose();
  S += mixed + mixed.transpose() + H * own * H.transpose();
}

StackedUpdate::Judged StackedUpdate::judge(ConstCovariance P, const ImageMeasurement& image,
                                           const TagMeasurement& m, const Turned& turned) const {
  Matrix6d apart = shared_own_ + image.shared.noise;
  if (m.own != TagMeasurement::kGiven) {
    const Matrix6d cross = shared_.middleRows<6>(m.own);
    apart += P.block<6, 6>(m.own, m.own) - cross - cross.transpose();
  }
  const double noise = turned.noise;
  Matrix6d S = turned.H * apart * turned.H.transpose();
  if (image.parameters.are_there()) add_parameters(P, image.parameters, m, turned, S);
  S.diagonal().array() += noise;
  const Eigen::LLT<Matrix6d> llt(S);
  if (llt.info() != Eigen::Success) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const double distance = llt.matrixL().solve(turned.y).squaredNorm() + turned.rest_square;
  return {distance, kRows * noise / (S.trace() + (kRows - kTurnedRows) * noise)};
}

StackedUpdate::Judged StackedUpdate::judge(ConstCovariance P, const ImageMeasurement& image,
                                           const TagMeasurement& m) const {
  Matrix8d S = m.R + m.H * image.shared.noise * m.H.transpose();
  for (std::size_t a = 0; a < m.block_count; ++a) {
    for (std::size_t b = 0; b < m.block_count; ++b)
      S.noalias() +=
          m.blocks[a].H * P.block<3, 3>(m.blocks[a].at, m.blocks[b].at) * m.blocks[b].H.transpose();
  }
  return {m.y.dot(S.ldlt().solve(m.y)), m.R.trace() / S.trace()};
}

void StackedUpdate::reserve(Eigen::Index rows) {
  if (PHt_.rows() >= n_ && PHt_.cols() >= rows) return;
  PHt_.resize(n_ + n_ / 2, rows * 2);
  shared_rows_.resize(rows * 2, 6);
  parameter_rows_.resize(rows * 2, ParameterColumns::kAll);
  own_rows_.resize(rows * 2, 6);
  shared_H_.setZero(8, rows * 2);
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
    if (m.relative && image.parameters.are_there())
      stack_parameters(P, image.parameters, m, turned_[i], at);
    if (m.relative)
      shared_H_.block<6, kTurnedRows>(0, at) = -turned_[i].H.transpose();
    else
      shared_H_.block<6, kRows>(0, at) = -m.H.transpose();
    at += rows_of(m);
  }
  view_gain(image);
  at = 0;
  for (const std::size_t i : used_) {
    const TagMeasurement& m = image.tags[i];
    m.relative ? stack_scatter(image.parameters, m, turned_[i], at) : stack_scatter(m, at);
    at += rows_of(m);
  }
  if (image.shared.noise.isZero(0)) return;
  const auto H = shared_H_.topRows<6>().leftCols(rows_);
  for (Eigen::Index k = 0; k < rows_; ++k) {
    const Vector6d noisy = image.shared.noise * H.col(k);
    S_.col(k).head(rows_).noalias() += H.transpose() * noisy;
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

void StackedUpdate::stack_parameters(ConstCovariance P, const ParameterColumns& parameters,
                                     const TagMeasurement& m, const Turned& turned,
                                     Eigen::Index at) {
  const dense::View PHt{PHt_.col(at).data(), PHt_.outerStride()};
  const dense::ConstView H_size{turned.H_parameters.col(ParameterColumns::kOfCamera).data(),
                                kTurnedRows};
  dense::add_product(columns_of(P, parameters.camera), ParameterColumns::kOfCamera,
                     {turned.H_parameters.data(), kTurnedRows}, PHt, n_);
  dense::add_product(columns_of(P, parameters.size), 1, H_size, PHt, n_);
  if (m.own_size >= 0) dense::add_product(columns_of(P, m.own_size), 1, H_size, PHt, n_);
}

void StackedUpdate::stack_gain(ConstCovariance P, const TagMeasurement& m, Eigen::Index at) {
  y_.segment<kRows>(at) = m.y;
  auto PHt = PHt_.middleCols<kRows>(at).topRows(n_);
  PHt.setZero();
  for (std::size_t b = 0; b < m.block_count; ++b)
    PHt.noalias() += P.middleCols<3>(m.blocks[b].at) * m.blocks[b].H.transpose();
}

/// Collects the rows of PHt that all relative measurements need.
void StackedUpdate::view_gain(const ImageMeasurement& image) {
  const auto PHt = PHt_.leftCols(rows_);
  shared_rows_.topRows(rows_).setZero();
  for (std::size_t t = 0; t < image.shared.term_count; ++t) {
    const LinearTerm& term = image.shared.terms[t];
    own_rows_.topRows(rows_).leftCols<3>() = PHt.middleRows<3>(term.at).transpose();
    dense::add_product(kalman::view_of(own_rows_), 3, {term.J.data(), kTurnedRows},
                       kalman::view_of(shared_rows_), rows_);
  }
  if (!image.parameters.are_there()) return;
  constexpr int kCamera = ParameterColumns::kOfCamera;
  parameter_rows_.topRows(rows_).leftCols<kCamera>() =
      PHt.middleRows<kCamera>(image.parameters.camera).transpose();
  parameter_rows_.col(kCamera).head(rows_) = PHt.row(image.parameters.size).transpose();
}

/// Columns of S from the diagonal down.
void StackedUpdate::stack_scatter(const ParameterColumns& parameters, const TagMeasurement& m,
                                  const Turned& turned, Eigen::Index at) {
  const Eigen::Index rest = rows_ - at;
  const auto PHt = PHt_.middleCols(at, rest);
  const dense::View S{&S_(at, at), S_.outerStride()};
  const bool is_given = m.own == TagMeasurement::kGiven;
  if (!is_given) own_rows_.topRows(rest) = PHt.middleRows<kTurnedRows>(m.own).transpose();
  dense::multiply_difference({is_given ? nullptr : own_rows_.data(), own_rows_.outerStride()},
                             {&shared_rows_(at, 0), shared_rows_.outerStride()},
                             {turned.H.data(), kTurnedRows}, S, rest);
  S_.diagonal().segment<kTurnedRows>(at).array() += turned.noise;
  if (!parameters.are_there()) return;
  dense::add_product({&parameter_rows_(at, 0), parameter_rows_.outerStride()},
                     ParameterColumns::kAll, {turned.H_parameters.data(), kTurnedRows}, S, rest);
  if (m.own_size < 0) return;
  own_rows_.col(0).head(rest) = PHt.row(m.own_size).transpose();
  dense::add_product(kalman::view_of(own_rows_), 1,
                     {turned.H_parameters.col(ParameterColumns::kOfCamera).data(), kTurnedRows}, S,
                     rest);
}

void StackedUpdate::stack_scatter(const TagMeasurement& m, Eigen::Index at) {
  auto S = S_.block(at, at, rows_ - at, kRows);
  S.setZero();
  for (std::size_t b = 0; b < m.block_count; ++b)
    S.noalias() += PHt_.middleRows<3>(m.blocks[b].at).middleCols(at, rows_ - at).transpose() *
                   m.blocks[b].H.transpose();
  S.topRows<kRows>() += m.R;
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
