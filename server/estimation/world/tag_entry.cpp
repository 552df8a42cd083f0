#include "estimation/world/tag_entry.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/filter/growing_covariance.hpp"
#include "estimation/filter/matrix6.hpp"
#include "estimation/world/corner_measurement.hpp"

namespace fiducap::world {

namespace {
// Lens errors above which the initial pose of a tag is too far away for one linear step.
constexpr double kFocalFarOff = 1e-3;
constexpr double kCentreFarOff_px = 1.0;
constexpr double kDistortionFarOff = 1e-2;
constexpr int kStepsWhenFarOff = 4;

/// A tag's pose by its corners: H_T ξ_T = y − Σ H_b ξ_b − n over the other blocks b, solved for ξ_T
/// by weighted least squares.
struct PlaceByCorners {
  Eigen::Matrix<double, 6, 8> solve;  ///< ∂ ξ_T / ∂ y
  Matrix6d own;                       ///< Covariance by n.
};

PlaceByCorners place_by_corners(const TagMeasurement& m, int at) {
  Matrix86d H = Matrix86d::Zero();
  for (std::size_t b = 0; b < m.block_count; ++b) {
    if (m.blocks[b].at == at) H.leftCols<3>() = m.blocks[b].H;
    if (m.blocks[b].at == at + 3) H.rightCols<3>() = m.blocks[b].H;
  }
  const Eigen::Matrix<double, 6, 8> weighted = m.R.ldlt().solve(H).transpose();
  const Matrix6d own = inverse6(weighted * H);
  return {own * weighted, 0.5 * (own + own.transpose())};
}

/// Corrects the pose of the newest tag, found with the configured lens, for the estimated lens.
void correct_place(FilterState& state, int camera, const CameraModel& model, const TagToUse& tag,
                   const CornerNoise& noise) {
  const int at = state.tag_at(static_cast<std::size_t>(tag.local));
  const LensOffset& lens = state.lenses[static_cast<std::size_t>(camera)];
  const bool is_far_off = std::abs(lens.focal) > kFocalFarOff ||
                          lens.centre_px.norm() > kCentreFarOff_px ||
                          std::abs(lens.k1) > kDistortionFarOff;
  for (int step = 0; is_far_off && step < kStepsWhenFarOff; ++step) {
    const TagMeasurement m = measure(state, camera, model, tag, noise);
    Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
    error.tail<6>() = place_by_corners(m, at).solve * m.y;
    if (!m.in_front || !error.allFinite()) return;
    state.add_error(error);
  }
}

// Held tags out of view, the last ones seen: their correlation with the body is kept for a while at
// bounded cost.
constexpr std::size_t kHeldOutOfView = 12;
bool is_in_view(const TagObservations& seen, int tag_id) {
  return std::ranges::find(seen.tags, tag_id, &TagObservation::tag_id) != seen.tags.end();
}

}  // namespace

void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, const CornerNoise& noise) {
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  const Pose X_WV =
      state.X_WB_after(clock.seconds_to(0)) * state.X_BV[static_cast<std::size_t>(camera)];
  const int local = static_cast<int>(state.tags.size());
  state.add_tag({{.tag_id = seen.tag_id, .edge_m = seen.edge_m, .sightings = 1}, X_WV * X_VT},
                Matrix6d::Zero());

  const TagToUse use{&seen, local, nullptr};
  const int at = state.tag_at(static_cast<std::size_t>(local));
  correct_place(state, camera, model, use, noise);
  const TagMeasurement m = measure(state, camera, model, use, noise);
  const PlaceByCorners place = place_by_corners(m, at);
  std::array<LinearTerm, TagMeasurement::kMaxBlocks> terms;
  std::size_t count = 0;
  for (std::size_t b = 0; b < m.block_count; ++b) {
    if (m.blocks[b].at < at) terms[count++] = {m.blocks[b].at, -place.solve * m.blocks[b].H};
  }
  redefine(state.covariance, at, at + 3, std::span(terms).first(count), place.own);
  // The mean is the solution by the linearised corners.
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  error.tail<6>() = place.solve * m.y;
  state.add_error(error);
}

void hold(FilterState& state, const KnownTag& known, Instant at) {
  const Matrix6d J = world_from_plain_error(known.X_WT.p);
  state.add_tag({{known.tag_id, known.edge_m, 0, at, at}, known.X_WT, true},
                J * known.covariance * J.transpose());
}

void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior) {
  const Pose& X_WT = state.tags[tag].X_WT;
  Eigen::Matrix<double, 6, 1> y;
  y << prior.X_WT.p - X_WT.p, log_so3(prior.X_WT.q * X_WT.q.conjugate());
  const Matrix6d H = plain_from_world_error(X_WT.p);
  const int at = state.tag_at(tag);
  auto P = state.P();
  const Eigen::Matrix<double, Eigen::Dynamic, 6> PHt = P.middleCols<6>(at) * H.transpose();
  const Eigen::LDLT<Matrix6d> S(H * PHt.middleRows<6>(at) + prior.covariance);
  const Eigen::VectorXd dx = PHt * S.solve(y);
  const Eigen::MatrixXd correction = PHt * S.solve(PHt.transpose());
  P -= 0.5 * (correction + correction.transpose());
  state.add_error(dx);
}

std::optional<Pose> HeldTags::take_over(FilterState& state, const KnownMap& map, bool level) {
  if (!has_changed(map)) return std::nullopt;
  revision_ = map.revision;
  return exchange(state, map, level);
}

void HeldTags::follow(FilterState& state, const TagObservations& seen,
                      std::span<const KnownTag> known, const KnownMap* whole, bool is_anchored) {
  const auto is_gone = [&](int tag_id) {
    if (whole != nullptr) return whole->find(tag_id) == nullptr;
    return is_in_view(seen, tag_id) &&
           std::ranges::find(known, tag_id, &KnownTag::tag_id) == known.end();
  };
  for (std::size_t i = state.tags.size(); i-- > 0;)
    if (state.tags[i].held && is_gone(state.tags[i].tag_id)) state.remove_tag(i);
  if (is_anchored) {
    for (const KnownTag& tag : known)
      if (is_in_view(seen, tag.tag_id)) hold_one(state, tag, whole, seen.exposed_at);
  }
  forget(state, seen);
}

/// Keeps the last ones seen of those out of view.
void HeldTags::forget(FilterState& state, const TagObservations& seen) {
  out_of_view_.clear();
  for (std::size_t i = 0; i < state.tags.size(); ++i)
    if (state.tags[i].held && !is_in_view(seen, state.tags[i].tag_id)) out_of_view_.push_back(i);
  if (out_of_view_.size() <= kHeldOutOfView) return;
  const auto is_older = [&](std::size_t a, std::size_t b) {
    return std::pair(state.tags[a].last_seen, a) < std::pair(state.tags[b].last_seen, b);
  };
  std::ranges::sort(out_of_view_, is_older);
  out_of_view_.resize(out_of_view_.size() - kHeldOutOfView);
  std::ranges::sort(out_of_view_);
  state.remove_tags(out_of_view_);
}

void hold_one(FilterState& state, const KnownTag& tag, const KnownMap* whole, Instant at) {
  if (tag.is_exact() || state.find(tag.tag_id) >= 0) return;
  whole != nullptr ? hold_beside(state, tag, *whole, at) : hold(state, tag, at);
}

}  // namespace fiducap::world
