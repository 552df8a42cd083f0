#include "estimation/world/landmarks.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "base/expected.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/growing_covariance.hpp"
#include "estimation/filter/kalman_gain.hpp"
#include "estimation/world/corner_measurement.hpp"

namespace fiducap::world {

namespace {
using Matrix23d = Eigen::Matrix<double, 2, 3>;

constexpr double kNearest_m = 0.1;
constexpr int kMostSteps = 8;
constexpr double kSettled = 1e-6;  // change of direction, and of inverse depth as a share of it

/// ∂ ideal pixel / ∂ point in camera axes
Matrix23d pinhole_jacobian(const CameraModel& model, const Eigen::Vector3d& p_V) {
  const double w = 1 / p_V.z();
  Matrix23d J;
  J << model.fu * w, 0, -model.fu * w * w * p_V.x(), 0, model.fv * w, -model.fv * w * w * p_V.y();
  return J;
}

/// Least squares in (x/z, y/z, 1/z) of the last view's axes.
struct InverseDepthFit {
  Eigen::Matrix3d information;
  Eigen::Vector3d gradient;
  bool in_front;
};

InverseDepthFit linearise(const CameraModel& model, std::span<const LandmarkView> views,
                          const Eigen::Vector3d& x) {
  InverseDepthFit fit{Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero(), true};
  const Pose& X_WA = views.back().X_WV;
  for (const LandmarkView& view : views) {
    const Pose X_VA = view.X_WV.inverse() * X_WA;
    const Eigen::Matrix3d R_VA = X_VA.rotation();
    const Eigen::Vector3d h = R_VA * Eigen::Vector3d(x.x(), x.y(), 1) + x.z() * X_VA.p;
    if (!(h.z() > 0)) {
      fit.in_front = false;
      return fit;
    }
    Eigen::Matrix3d dh;
    dh << R_VA.col(0), R_VA.col(1), X_VA.p;
    const Eigen::Matrix2d raw_from_ideal = view.ideal_from_raw.inverse();
    const Matrix23d J = raw_from_ideal * pinhole_jacobian(model, h) * dh;
    const Eigen::Vector2d e = raw_from_ideal * (view.px - model.pinhole(h));
    fit.information += J.transpose() * J;
    fit.gradient += J.transpose() * e;
  }
  return fit;
}

constexpr int kMostRows = 2 * LandmarkMeasurement::kMostViews;

constexpr int kFewestViews = 4;  // leave five numbers of eight: enough to reject a wrong track

const PointObservation* find(const TagObservations& image, std::uint32_t track) {
  const auto found = std::ranges::lower_bound(image.points, track, {}, &PointObservation::track);
  return found == image.points.end() || found->track != track ? nullptr : &*found;
}
}  // namespace

std::optional<Triangulated> triangulate(const CameraModel& model,
                                        std::span<const LandmarkView> views, double noise_px) {
  const LandmarkView& last = views.back();
  // Starts at infinity: the problem is nearly linear in the inverse depth.
  Eigen::Vector3d x((last.px.x() - model.cu) / model.fu, (last.px.y() - model.cv) / model.fv, 0);
  for (int step = 0; step < kMostSteps; ++step) {
    const InverseDepthFit fit = linearise(model, views, x);
    if (!fit.in_front) return std::nullopt;
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(fit.information);
    const Eigen::Vector3d dx = ldlt.solve(fit.gradient);
    if (!dx.allFinite()) return std::nullopt;
    x += dx;
    if (!(dx.head<2>().norm() < kSettled &&
          std::abs(dx.z()) < kSettled + kSettled * std::abs(x.z())))
      continue;
    if (!(x.z() > 0) || 1 / x.z() < kNearest_m) return std::nullopt;
    const double sigma =
        noise_px * std::sqrt(std::max(0.0, ldlt.solve(Eigen::Vector3d::UnitZ()).z()));
    const Eigen::Vector3d p_V = Eigen::Vector3d(x.x(), x.y(), 1) / x.z();
    return Triangulated{last.X_WV * p_V, p_V.z(), sigma / x.z()};
  }
  return std::nullopt;
}

LandmarkMeasurement::LandmarkMeasurement(int slots)
    : y_(2 * kMostViews), H_(2 * kMostViews, 6 * slots), H_landmark_(2 * kMostViews, 3) {}

bool LandmarkMeasurement::build(const CameraModel& model, std::span<const LandmarkView> views,
                                const Eigen::Vector3d& p_W, const TrackNoise& noise) {
  const int n = static_cast<int>(views.size());
  FIDUCAP_ASSERT(n >= 3 && n <= kMostViews);
  H_.topRows(2 * n).setZero();
  for (int j = 0; j < n; ++j) {
    const LandmarkView& view = views[static_cast<std::size_t>(j)];
    const Eigen::Vector3d p_V = view.X_WV.inverse() * p_W;
    if (!(p_V.z() > kNearest_m)) return false;
    const Eigen::Matrix2d raw_from_ideal = view.ideal_from_raw.inverse();
    const Eigen::Vector2d e = raw_from_ideal * (view.px - model.pinhole(p_V));
    const Matrix23d G =
        raw_from_ideal * pinhole_jacobian(model, p_V) * view.X_WV.rotation().transpose();
    const Matrix23d G_turn = G * skew(p_W);
    for (int k = 0; k < 2; ++k) {
      const int row = k * n + j;
      y_(row) = e(k);
      H_landmark_.row(row) = G.row(k);
      H_.row(row).segment<3>(6 * view.slot) = -G.row(k);
      H_.row(row).segment<3>(6 * view.slot + 3) = G_turn.row(k);
    }
  }
  whiten(n, noise);
  turn_landmark_away(2 * n);
  rows_ = 2 * n - kLandmarkSize;
  return true;
}

void LandmarkMeasurement::whiten(int views, const TrackNoise& noise) {
  Eigen::Matrix<double, kMostViews, kMostViews> R;
  for (int a = 0; a < views; ++a) {
    for (int b = 0; b < views; ++b)
      R(a, b) = (a == b ? noise.white_px * noise.white_px : 0.0) +
                noise.walk_px * noise.walk_px * std::min(a, b);
  }
  // Cholesky and forward substitution, row by row.
  for (int a = 0; a < views; ++a) {
    for (int b = 0; b <= a; ++b) {
      double value = R(a, b);
      for (int k = 0; k < b; ++k) value -= R(a, k) * R(b, k);
      R(a, b) = b < a ? value / R(b, b) : std::sqrt(value);
    }
    for (int half = 0; half < 2; ++half) {
      const int row = half * views + a;
      for (int k = 0; k < a; ++k) {
        const int other = half * views + k;
        y_(row) -= R(a, k) * y_(other);
        H_landmark_.row(row) -= R(a, k) * H_landmark_.row(other);
        H_.row(row) -= R(a, k) * H_.row(other);
      }
      y_(row) /= R(a, a);
      H_landmark_.row(row) /= R(a, a);
      H_.row(row) /= R(a, a);
    }
  }
}

void LandmarkMeasurement::turn_landmark_away(int rows) {
  // Three Householder reflections make the landmark's Jacobian upper triangular.
  Eigen::Matrix<double, 2 * kMostViews, 1> axis;
  for (int c = 0; c < kLandmarkSize; ++c) {
    const int tail = rows - c;
    auto v = axis.head(tail);
    v = H_landmark_.col(c).segment(c, tail);
    const double norm = v.norm();
    v(0) += v(0) < 0 ? -norm : norm;
    const double scale = v.squaredNorm();
    if (!(scale > 0)) continue;
    const double factor = 2 / scale;
    for (int k = c; k < kLandmarkSize; ++k) {
      const double along = factor * v.dot(H_landmark_.col(k).segment(c, tail));
      H_landmark_.col(k).segment(c, tail) -= along * v;
    }
    y_.segment(c, tail) -= (factor * v.dot(y_.segment(c, tail))) * v;
    for (Eigen::Index k = 0; k < H_.cols(); ++k) {
      const double along = factor * v.dot(H_.col(k).segment(c, tail));
      if (along != 0) H_.col(k).segment(c, tail) -= along * v;
    }
  }
}

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
  const auto met = triangulate(model, views, rules_.noise.white_px);
  if (!met || !(met->relative_sigma < rules_.most_relative_sigma) ||
      !one_.build(model, views, met->p_W, rules_.noise)) {
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
  return head.squaredNorm() < gates_[static_cast<std::size_t>(m)];  // rejects NaN as well
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

CloneWindow::CloneWindow(std::size_t cameras, const LandmarkRules& rules)
    : longest_(kClones / static_cast<int>(cameras)), update_(kClones, rules) {}

void CloneWindow::clone(FilterState& state, int camera, long image) {
  const auto oldest = std::ranges::min_element(state.clones, {}, &Clone::image);
  const CameraAt at_exposure =
      camera_at(state, camera, state.clocks[static_cast<std::size_t>(camera)].seconds_to(0));
  *oldest = {at_exposure.X_WV, camera, image};
  const int at = state.clone_at(static_cast<std::size_t>(oldest - state.clones.begin()));
  // Except for the clock, the clone's error equals that of the camera (X_WV).
  const SharedPose error = error_of(at_exposure, camera);
  redefine(state.covariance, at, at + 3, std::span(error.terms).first(error.term_count),
           Matrix6d::Zero());
}

LandmarkReport CloneWindow::correct(FilterState& state, ImageMemory& memory,
                                    const CameraModel& model, int camera) {
  if (longest_ < kFewestViews) return {};
  list_images(state, memory, camera);
  if (images_.size() < static_cast<std::size_t>(kFewestViews)) return {};
  list_due();
  update_.begin();
  for (const Due& due : due_) {
    if (update_.is_full()) break;
    gather(state, due.track, due.first_age, due.last_age);
    if (static_cast<int>(views_.size()) >= kFewestViews) update_.add(state, model, views_);
  }
  return update_.apply(state);
}

void CloneWindow::list_images(const FilterState& state, ImageMemory& memory, int camera) {
  images_.clear();
  for (std::size_t k = 0; k < state.clones.size(); ++k) {
    const Clone& clone = state.clones[k];
    if (clone.image < 0 || clone.camera != camera || !memory.has(clone.image)) continue;
    images_.push_back({static_cast<int>(k), &memory.image(clone.image).seen});
  }
  std::ranges::sort(images_, {}, [](const Seen& seen) { return seen.image->exposed_at; });
}

void CloneWindow::list_due() {
  due_.clear();
  const TagObservations& now = *images_.back().image;
  const TagObservations& before = *images_[images_.size() - 2].image;
  for (const PointObservation& point : now.points) {
    if (point.age % longest_ == longest_ - 1)
      due_.push_back({point.track, point.age - longest_ + 1, point.age});
  }
  for (const PointObservation& point : before.points) {
    const int length = point.age % longest_ + 1;
    if (length < longest_ && length >= kFewestViews && find(now, point.track) == nullptr) {
      due_.push_back({point.track, point.age - length + 1, point.age});
    }
  }
  // Long ones first: they have most information when not all can be used.
  std::ranges::stable_sort(due_, [](const Due& a, const Due& b) {
    return a.last_age - a.first_age > b.last_age - b.first_age;
  });
}

void CloneWindow::gather(const FilterState& state, std::uint32_t track, int first_age,
                         int last_age) {
  views_.clear();
  for (const Seen& seen : images_) {
    const PointObservation* point = find(*seen.image, track);
    if (point == nullptr || point->age < first_age || point->age > last_age) continue;
    views_.push_back({seen.slot, state.clones[static_cast<std::size_t>(seen.slot)].X_WV, point->px,
                      point->ideal_from_raw});
  }
}

}  // namespace fiducap::world
