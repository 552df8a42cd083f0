#include "support/bound/causal_bound.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::bound {

namespace {

// Prior at the start, 1-sigma (half or twice as much changes results after 5 s by 0.1 % or less).
constexpr double kStartTilt_rad = 0.5;
constexpr double kStartVelocity_m_s = 1.0;
constexpr double kStartBiasW_rad_s = 0.02;
constexpr double kStartBiasF_m_s2 = 0.2;
// With a known map, place and heading are unknown: far beyond a room, small enough for double.
constexpr double kStartPosition_m = 10.0;
constexpr double kStartYaw_rad = 3.0;

double root_trace(const Eigen::MatrixXd& covariance) { return std::sqrt(covariance.trace()); }

void set_variance(Eigen::MatrixXd& P, int at, double sigma) {
  P.diagonal().segment<3>(at).setConstant(sigma * sigma);
}

Eigen::Matrix<double, 8, 21> body_rows(const CornerRows& rows) {
  Eigen::Matrix<double, 8, 21> H = Eigen::Matrix<double, 8, 21>::Zero();
  H.middleCols<3>(kRotation) = rows.rotation;
  H.middleCols<3>(kPosition) = rows.position;
  H.middleCols<6>(kExtrinsicsP) = rows.extrinsics;
  return H;
}

}  // namespace

CausalBound::CausalBound(BoundProblem problem) : problem_(std::move(problem)) {
  const int per_tag = (problem_.map_known ? 0 : 6) + (problem_.lasting ? 8 : 0);
  const auto capacity = kFirstTag + per_tag * static_cast<int>(problem_.tags.size());
  P_.setZero(capacity, capacity);
  for (const RecordedTag& tag : problem_.tags) places_.push_back({&tag});
  std::ranges::sort(places_, {}, [](const Place& place) { return place.tag->tag_id; });
}

void CausalBound::start(const TruthSample& truth) {
  set_variance(P_, kRotation, kStartTilt_rad);
  P_(kRotation + 2, kRotation + 2) = problem_.map_known ? kStartYaw_rad * kStartYaw_rad : 0.0;
  set_variance(P_, kVelocity, kStartVelocity_m_s);
  set_variance(P_, kPosition, problem_.map_known ? kStartPosition_m : 0.0);
  set_variance(P_, kBiasW, kStartBiasW_rad_s);
  set_variance(P_, kBiasF, kStartBiasF_m_s2);
  set_variance(P_, kExtrinsicsP,
               problem_.extrinsics_known ? 0.0 : problem_.camera.position_sigma_m);
  set_variance(P_, kExtrinsicsQ,
               problem_.extrinsics_known ? 0.0 : problem_.camera.rotation_sigma_rad);
  Phi_.setIdentity();
  Q_.setZero();
  truth_ = truth;
}

void CausalBound::move_to(const TruthSample& truth) {
  if (!truth_) return start(truth);
  const InertialStep step = inertial_step(*truth_, truth, problem_.imu, problem_.gravity_m_s2);
  Phi_ = (step.Phi * Phi_).eval();
  Q_ = (step.Phi * Q_ * step.Phi.transpose() + step.Q).eval();
  truth_ = truth;
  moved_ = true;
}

void CausalBound::apply_motion() {
  if (!moved_) return;
  const int others = size_ - kBody;
  const Matrix15 body = Phi_ * P_.topLeftCorner<kBody, kBody>() * Phi_.transpose() + Q_;
  const Eigen::MatrixXd cross = Phi_ * P_.block(0, kBody, kBody, others);
  P_.topLeftCorner<kBody, kBody>() = 0.5 * (body + body.transpose());
  P_.block(0, kBody, kBody, others) = cross;
  P_.block(kBody, 0, others, kBody) = cross.transpose();
  Phi_.setIdentity();
  Q_.setZero();
  moved_ = false;
}

std::size_t CausalBound::index_of(int tag_id) const {
  const auto found = std::ranges::lower_bound(places_, tag_id, {},
                                              [](const Place& place) { return place.tag->tag_id; });
  FIDUCAP_ASSERT(found != places_.end() && found->tag->tag_id == tag_id);
  return static_cast<std::size_t>(found - places_.begin());
}

int CausalBound::lasting_at(int tag_id) {
  if (!problem_.lasting) return -1;
  const Instant now = truth_->at;
  const auto is_over = [&](const Visit& visit) {
    return now - visit.last_seen > problem_.lasting->visit_ends;
  };
  auto found = std::find_if(visits_.begin(), visits_.end(), [&](const Visit& visit) {
    return visit.tag_id == tag_id && !is_over(visit);
  });
  if (found == visits_.end()) {
    found = std::find_if(visits_.begin(), visits_.end(), is_over);
    if (found == visits_.end()) {
      found = visits_.insert(visits_.end(), {.at = size_});
      size_ += 8;
    }
    found->tag_id = tag_id;
    P().middleCols<8>(found->at).setZero();
    P().middleRows<8>(found->at).setZero();
    P().diagonal().segment<8>(found->at).setOnes();
  } else {
    fade(*found);
  }
  found->last_seen = now;
  return found->at;
}

/// l ← a l + √(1 − a²) w, with unit w.
void CausalBound::fade(const Visit& visit) {
  const double a = std::exp(-to_seconds(truth_->at - visit.last_seen) / problem_.lasting->fades_s);
  P().middleRows<8>(visit.at) *= a;
  P().middleCols<8>(visit.at) *= a;
  P().diagonal().segment<8>(visit.at).array() += 1 - a * a;
}

void CausalBound::see(std::span<const int> ids) {
  std::vector<TagSight> sights;
  for (const int id : ids) sights.push_back({id, Matrix8::Identity() / problem_.corner_noise_px});
  see(sights);
}

void CausalBound::see(std::span<const TagSight> sights) {
  FIDUCAP_ASSERT(truth_.has_value());
  apply_motion();
  std::vector<Newcomer> newcomers;
  std::vector<Measurement> all;
  for (const TagSight& sight : sights) {
    Place& place = places_[index_of(sight.tag_id)];
    const CornerRows corner = corner_rows(truth_->X_WB, problem_.camera, *place.tag, 1.0);
    const Eigen::Matrix<double, 8, 6> by_tag = sight.whiten * corner.tag;
    Measurement measured{{0, sight.whiten * body_rows(corner)}};
    if (const int at = lasting_at(sight.tag_id); at >= 0) measured.push_back({at, sight.lasting});
    if (place.at >= 0) measured.push_back({place.at, by_tag});
    if (problem_.map_known || place.at >= 0) {
      all.push_back(std::move(measured));
      continue;
    }
    const Eigen::HouseholderQR<Eigen::Matrix<double, 8, 6>> qr(by_tag);
    const Matrix8 turn = Matrix8(qr.householderQ()).transpose();
    Measurement rest;
    for (Part& part : measured) {
      const Eigen::MatrixXd turned = turn * part.H;
      rest.push_back({part.at, turned.bottomRows<2>()});
      part.H = turned.topRows<6>();
    }
    all.push_back(std::move(rest));
    newcomers.push_back(
        {&place, std::move(measured), qr.matrixQR().topRows<6>().triangularView<Eigen::Upper>()});
  }
  if (!all.empty()) update(all);
  for (const Newcomer& one : newcomers) join(one);
}

Eigen::MatrixXd CausalBound::times(const Measurement& measurement) const {
  Eigen::MatrixXd PHt = Eigen::MatrixXd::Zero(size_, measurement.front().H.rows());
  for (const Part& part : measurement)
    PHt.noalias() += P().middleCols(part.at, part.H.cols()) * part.H.transpose();
  return PHt;
}

void CausalBound::update(const std::vector<Measurement>& all) {
  Eigen::Index count = 0;
  for (const Measurement& one : all) count += one.front().H.rows();
  Eigen::MatrixXd PHt(size_, count);
  Eigen::Index first = 0;
  for (const Measurement& one : all) {
    PHt.middleCols(first, one.front().H.rows()) = times(one);
    first += one.front().H.rows();
  }
  Eigen::MatrixXd S = Eigen::MatrixXd::Identity(count, count);
  first = 0;
  for (const Measurement& one : all) {
    auto rows = S.middleRows(first, one.front().H.rows());
    for (const Part& part : one) rows.noalias() += part.H * PHt.middleRows(part.at, part.H.cols());
    first += one.front().H.rows();
  }
  const Eigen::LLT<Eigen::MatrixXd> llt(S);
  FIDUCAP_ASSERT(llt.info() == Eigen::Success);
  const Eigen::MatrixXd W = llt.matrixL().solve(PHt.transpose()).transpose();
  auto whole = P();
  whole.selfadjointView<Eigen::Lower>().rankUpdate(W, -1.0);
  whole.triangularView<Eigen::StrictlyUpper>() = whole.transpose();
}

/// The corners measure R ξ_T = −Σ H ξ − n, with the other parts of the state.
void CausalBound::join(const Newcomer& one) {
  const auto upper = one.R.triangularView<Eigen::Upper>();
  const Eigen::Matrix<double, 6, 6> own = upper.solve(Eigen::Matrix<double, 6, 6>::Identity());
  const Eigen::MatrixXd cross = -own * times(one.by_others).transpose();
  Eigen::MatrixXd block = own * own.transpose();
  for (const Part& part : one.by_others)
    block -= cross.middleCols(part.at, part.H.cols()) * (own * part.H).transpose();
  one.place->at = size_;
  P_.block(size_, 0, 6, size_) = cross;
  P_.block(0, size_, size_, 6) = cross.transpose();
  P_.block<6, 6>(size_, size_) = 0.5 * (block + block.transpose());
  size_ += 6;
}

Matrix12 CausalBound::body_and_tag(int tag_id) const {
  const Place& place = places_[index_of(tag_id)];
  FIDUCAP_ASSERT(!moved_ && (place.at >= 0 || problem_.map_known));
  std::vector<int> index;
  for (const int at : {kRotation, kPosition}) index.insert(index.end(), {at, at + 1, at + 2});
  Matrix12 out = Matrix12::Zero();
  if (problem_.map_known) {
    out.topLeftCorner<6, 6>() = marginal(P_, index);
    return out;
  }
  for (int i = 0; i < 6; ++i) index.push_back(place.at + i);
  out = marginal(P_, index);
  return out;
}

std::optional<BoundAt> CausalBound::now() const {
  const Place& reference = places_[index_of(problem_.reference_tag)];
  if (!truth_ || moved_ || (reference.at < 0 && !problem_.map_known)) return std::nullopt;
  const Pose& X_WT = reference.tag->X_WT;
  const Matrix12 joint = body_and_tag(problem_.reference_tag);
  const auto covariance = [&](const RelativeRows& J) -> Eigen::Matrix<double, 6, 6> {
    return J * joint * J.transpose();
  };
  const auto near = covariance(relative_to_tag(truth_->X_WB, X_WT));
  const auto level = covariance(relative_to_level(truth_->X_WB, X_WT, heading_axis(X_WT.q)));
  Eigen::Matrix<double, 3, 6> by_motion;  // rotation, velocity → v_WB_B
  by_motion << skew(truth_->v_WB), Eigen::Matrix3d::Identity();
  return BoundAt{
      .at = truth_->at,
      .position_m = root_trace(near.topLeftCorner<3, 3>()),
      .rotation_rad = root_trace(near.bottomRightCorner<3, 3>()),
      .level_position_m = root_trace(level.topLeftCorner<3, 3>()),
      .level_rotation_rad = root_trace(level.bottomRightCorner<3, 3>()),
      .velocity_m_s = root_trace(by_motion * P_.topLeftCorner<6, 6>() * by_motion.transpose()),
      .camera_m = camera_sigma(reference)};
}

/// p_WV by body rotation, position and p_BV; then seen from the tag.
double CausalBound::camera_sigma(const Place& reference) const {
  const Eigen::Matrix3d R_WB = truth_->X_WB.rotation();
  const Eigen::Vector3d arm_W = R_WB * problem_.camera.X_BV.p;
  const Pose X_WV{truth_->X_WB.q, truth_->X_WB.p + arm_W};
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, size_);
  J.middleCols<3>(kRotation) = -skew(arm_W);
  J.middleCols<3>(kPosition).setIdentity();
  J.middleCols<3>(kExtrinsicsP) = R_WB;
  if (reference.at >= 0) {
    J.middleCols<3>(reference.at) = -Eigen::Matrix3d::Identity();
    J.middleCols<3>(reference.at + 3) = skew(X_WV.p - reference.tag->X_WT.p);
  }
  return root_trace(J * P() * J.transpose());
}

MapBound CausalBound::map() const {
  MapBound out;
  const Place& reference = places_[index_of(problem_.reference_tag)];
  if (problem_.map_known || reference.at < 0) return out;
  double position2 = 0;
  double rotation2 = 0;
  int others = 0;
  for (const Place& place : places_) {
    if (place.at < 0 || &place == &reference) continue;
    // The tag as the "body": rotation, position; then the reference.
    std::vector<int> index;
    for (const int at : {place.at + 3, place.at, reference.at, reference.at + 3})
      index.insert(index.end(), {at, at + 1, at + 2});
    const RelativeRows J = relative_to_tag(place.tag->X_WT, reference.tag->X_WT);
    const Matrix12 joint = marginal(P_, index);
    const Eigen::Matrix<double, 6, 6> near = J * joint * J.transpose();
    position2 += near.topLeftCorner<3, 3>().trace();
    rotation2 += near.bottomRightCorner<3, 3>().trace();
    ++others;
  }
  if (others > 0) out = {std::sqrt(position2 / others), std::sqrt(rotation2 / others)};
  return out;
}

TagsCovariance CausalBound::tags() const {
  FIDUCAP_ASSERT(!problem_.map_known);
  TagsCovariance out;
  std::vector<int> index;
  for (const Place& place : places_) {
    if (place.at < 0) continue;
    out.ids.push_back(place.tag->tag_id);
    for (int i = 0; i < 6; ++i) index.push_back(place.at + i);
  }
  out.P = marginal(P_, index);
  return out;
}

}  // namespace fiducap::bound
