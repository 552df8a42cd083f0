#include "estimation/world/landmark_update.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/assert.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/kalman_gain.hpp"

namespace fiducap::world {

namespace {
constexpr int kMostRows = 2 * LandmarkMeasurement::kMostViews;
}  // namespace

LandmarkUpdate::LandmarkUpdate(int clones, const LandmarkRules& rules)
    : columns_(6 * clones),
      rules_(rules),
      one_(clones),
      H_(kMostLandmarks * kMostRows, columns_),
      y_(kMostLandmarks * kMostRows),
      HP_(kMostRows, columns_) {
  for (std::size_t dof = 1; dof < gates_.size(); ++dof)
    gates_[dof] = chi_square_quantile(static_cast<int>(dof), rules.gate_probability);
  const int most = std::max(kMostRows, columns_);
  S_.resize(most, most);
}

void LandmarkUpdate::begin() {
  report_ = {};
  landmarks_ = 0;
  rows_ = 0;
}

void LandmarkUpdate::add(const FilterState& state, const CameraModel& model,
                         std::span<const LandmarkView> views) {
  FIDUCAP_ASSERT(!is_full());
  const auto meet = triangulate(model, views, rules_.noise.white_px);
  if (!meet || !(meet->relative_sigma < rules_.most_relative_sigma) ||
      !one_.build(model, views, meet->p_W, rules_.noise)) {
    ++report_.shallow;
    return;
  }
  if (!passes_gate(state)) {
    ++report_.rejected;
    return;
  }
  H_.middleRows(rows_, one_.rows()) = one_.H();
  y_.segment(rows_, one_.rows()) = one_.y();
  rows_ += one_.rows();
  ++landmarks_;
}

bool LandmarkUpdate::passes_gate(const FilterState& state) {
  const auto P = state.P().block(state.clone_at(0), state.clone_at(0), columns_, columns_);
  const int m = one_.rows();
  auto HP = HP_.topRows(m);
  auto S = S_.topLeftCorner(m, m);
  HP.noalias() = one_.H() * P;
  S.noalias() = HP * one_.H().transpose();
  S.diagonal().array() += 1;
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
  Eigen::Matrix<double, kMostRows, 1> whitened;
  whitened.head(m) = one_.y();
  auto head = whitened.head(m);
  llt.matrixL().solveInPlace(head);
  return head.squaredNorm() < gates_[static_cast<std::size_t>(m)];  // NaN stays out as well
}

void LandmarkUpdate::compress() {
  if (rows_ <= columns_) return;
  for (int c = 0; c < columns_; ++c) {
    const int tail = rows_ - c;
    auto v = H_.col(c).segment(c, tail);  // becomes the axis of the reflection
    const double norm = v.norm();
    const double diagonal = v(0) < 0 ? norm : -norm;
    v(0) -= diagonal;
    const double scale = v.squaredNorm();
    if (scale > 0) {
      const double factor = 2 / scale;
      for (int k = c + 1; k < columns_; ++k) {
        auto column = H_.col(k).segment(c, tail);
        column -= (factor * v.dot(column)) * v;
      }
      auto y = y_.segment(c, tail);
      y -= (factor * v.dot(y)) * v;
    }
    v.setZero();
    v(0) = diagonal;
  }
  rows_ = columns_;
}

LandmarkReport LandmarkUpdate::apply(FilterState& state) {
  report_.used = landmarks_;
  if (landmarks_ == 0) return report_;
  compress();
  const Eigen::Index n = state.size();
  if (PHt_.rows() < n || PHt_.cols() < columns_) {
    PHt_.resize(n + n / 2, columns_);
    dx_.resize(n + n / 2);
  }
  const auto H = H_.topRows(rows_);
  auto PHt = PHt_.topLeftCorner(n, rows_);
  auto S = S_.topLeftCorner(rows_, rows_);
  auto dx = dx_.head(n);
  PHt.noalias() = state.P().middleCols(state.clone_at(0), columns_) * H.transpose();
  S.noalias() = H * PHt.middleRows(state.clone_at(0), columns_);
  S.diagonal().array() += 1;
  report_.nis = kalman::solve(PHt, S, y_.head(rows_), state.held_tags(), dx);
  report_.nis_dof = rows_;
  kalman::shrink(state.P(), PHt, state.held_tags(), held_);
  state.add_error(dx);
  return report_;
}

}  // namespace fiducap::world
