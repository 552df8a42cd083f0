#include "support/bound/causal_bound.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/assert.hpp"
#include "base/so3.hpp"

namespace fiducap::bound {

namespace {

// How little is known at the start, 1-sigma (halving or widening these changes results after 5 s by
// 0.1 % or less).
constexpr double kStartTilt_rad = 0.5;
constexpr double kStartVelocity_m_s = 1.0;
constexpr double kStartBiasW_rad_s = 0.02;
constexpr double kStartBiasF_m_s2 = 0.2;
// With a known map place and heading are unknown: far beyond a room, small enough for double.
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
  const auto capacity =
      kFirstTag + (problem_.map_known ? 0 : 6 * static_cast<int>(problem_.tags.size()));
  P_.setZero(capacity, capacity);
  for (const RecordedTag& tag : problem_.tags) places_.push_back({&tag});
  std::sort(places_.begin(), places_.end(),
            [](const Place& a, const Place& b) { return a.tag->tag_id < b.tag->tag_id; });
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
  const auto found =
      std::lower_bound(places_.begin(), places_.end(), tag_id,
                       [](const Place& place, int id) { return place.tag->tag_id < id; });
  FIDUCAP_ASSERT(found != places_.end() && found->tag->tag_id == tag_id);
  return static_cast<std::size_t>(found - places_.begin());
}

void CausalBound::see(std::span<const int> ids) {
  see(ids, std::vector<double>(ids.size(), problem_.corner_noise_px));
}

void CausalBound::see(std::span<const int> ids, std::span<const double> noise_px) {
  FIDUCAP_ASSERT(truth_.has_value() && ids.size() == noise_px.size());
  apply_motion();
  struct Newcomer {
    Place* place;
    Eigen::Matrix<double, 6, 21> by_body;
    Eigen::Matrix<double, 6, 6> R;
  };
  std::vector<Newcomer> newcomers;
  std::vector<Row> rows;
  for (std::size_t k = 0; k < ids.size(); ++k) {
    Place& place = places_[index_of(ids[k])];
    const CornerRows corner = corner_rows(truth_->X_WB, problem_.camera, *place.tag, noise_px[k]);
    const Eigen::Matrix<double, 8, 21> H = body_rows(corner);
    if (problem_.map_known) {
      rows.push_back({H, {}, -1});
    } else if (place.at >= 0) {
      rows.push_back({H, corner.tag, place.at});
    } else {
      const Eigen::HouseholderQR<Eigen::Matrix<double, 8, 6>> qr(corner.tag);
      const Eigen::Matrix<double, 8, 21> turned = qr.householderQ().transpose() * H;
      rows.push_back({turned.bottomRows<2>(), {}, -1});
      const Eigen::Matrix<double, 6, 6> R =
          qr.matrixQR().topRows<6>().triangularView<Eigen::Upper>();
      newcomers.push_back({&place, turned.topRows<6>(), R});
    }
  }
  if (!rows.empty()) update(rows);
  for (const Newcomer& one : newcomers) join(*one.place, one.by_body, one.R);
}

void CausalBound::update(const std::vector<Row>& rows) {
  Eigen::Index count = 0;
  for (const Row& row : rows) count += row.H_body.rows();
  Eigen::MatrixXd PHt(size_, count);
  Eigen::Index first = 0;
  for (const Row& row : rows) {
    const Eigen::Index n = row.H_body.rows();
    auto columns = PHt.middleCols(first, n);
    columns.noalias() = P().leftCols<kFirstTag>() * row.H_body.transpose();
    if (row.tag_at >= 0) columns.noalias() += P().middleCols<6>(row.tag_at) * row.H_tag.transpose();
    first += n;
  }
  Eigen::MatrixXd S = Eigen::MatrixXd::Identity(count, count);
  first = 0;
  for (const Row& row : rows) {
    const Eigen::Index n = row.H_body.rows();
    S.middleRows(first, n).noalias() += row.H_body * PHt.topRows<kFirstTag>();
    if (row.tag_at >= 0)
      S.middleRows(first, n).noalias() += row.H_tag * PHt.middleRows<6>(row.tag_at);
    first += n;
  }
  const Eigen::LLT<Eigen::MatrixXd> llt(S);
  FIDUCAP_ASSERT(llt.info() == Eigen::Success);
  const Eigen::MatrixXd W = llt.matrixL().solve(PHt.transpose()).transpose();
  auto whole = P();
  whole.selfadjointView<Eigen::Lower>().rankUpdate(W, -1.0);
  whole.triangularView<Eigen::StrictlyUpper>() = whole.transpose();
}

void CausalBound::join(Place& place, const Eigen::Matrix<double, 6, 21>& by_body,
                       const Eigen::Matrix<double, 6, 6>& R) {
  const auto upper = R.triangularView<Eigen::Upper>();
  const Eigen::Matrix<double, 6, 21> A = -upper.solve(by_body);
  const Eigen::Matrix<double, 6, 6> own = upper.solve(Eigen::Matrix<double, 6, 6>::Identity());
  const Eigen::MatrixXd cross = A * P().topRows<kFirstTag>();
  const Eigen::Matrix<double, 6, 6> block =
      cross.leftCols<kFirstTag>() * A.transpose() + own * own.transpose();
  place.at = size_;
  P_.block(size_, 0, 6, size_) = cross;
  P_.block(0, size_, size_, 6) = cross.transpose();
  P_.block<6, 6>(size_, size_) = 0.5 * (block + block.transpose());
  size_ += 6;
}

Eigen::Matrix<double, 12, 12> CausalBound::body_and_tag(int tag_id) const {
  const Place& place = places_[index_of(tag_id)];
  FIDUCAP_ASSERT(!moved_ && (place.at >= 0 || problem_.map_known));
  std::vector<int> index;
  for (const int at : {kRotation, kPosition}) {
    for (int i = 0; i < 3; ++i) index.push_back(at + i);
  }
  Eigen::Matrix<double, 12, 12> out = Eigen::Matrix<double, 12, 12>::Zero();
  if (problem_.map_known) {
    out.topLeftCorner<6, 6>() = P_(index, index);
    return out;
  }
  for (int i = 0; i < 6; ++i) index.push_back(place.at + i);
  out = P_(index, index);
  return out;
}

std::optional<BoundAt> CausalBound::now() const {
  const Place& reference = places_[index_of(problem_.reference_tag)];
  if (!truth_ || moved_ || (reference.at < 0 && !problem_.map_known)) return std::nullopt;
  const Pose& X_WB = truth_->X_WB;
  const Pose& X_WT = reference.tag->X_WT;
  const Eigen::Matrix<double, 12, 12> joint = body_and_tag(problem_.reference_tag);
  const auto covariance = [&](const RelativeRows& J) -> Eigen::Matrix<double, 6, 6> {
    return J * joint * J.transpose();
  };
  const auto near = covariance(relative_to_tag(X_WB, X_WT));
  const auto level = covariance(relative_to_level(X_WB, X_WT, heading_axis(X_WT.q)));
  BoundAt out;
  out.at = truth_->at;
  out.position_m = root_trace(near.topLeftCorner<3, 3>());
  out.rotation_rad = root_trace(near.bottomRightCorner<3, 3>());
  out.level_position_m = root_trace(level.topLeftCorner<3, 3>());
  out.level_rotation_rad = root_trace(level.bottomRightCorner<3, 3>());
  Eigen::Matrix<double, 3, 6> by_motion;  // rotation, velocity → v_WB_B
  by_motion << skew(truth_->v_WB), Eigen::Matrix3d::Identity();
  out.velocity_m_s = root_trace(by_motion * P_.topLeftCorner<6, 6>() * by_motion.transpose());
  out.camera_m = camera_sigma(reference);
  out.extrinsics_m = root_trace(P_.block<3, 3>(kExtrinsicsP, kExtrinsicsP));
  out.extrinsics_rad = root_trace(P_.block<3, 3>(kExtrinsicsQ, kExtrinsicsQ));
  return out;
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
  for (const Place& place : places_) {
    if (place.at < 0 || place.at == reference.at) continue;
    // The tag as the "body": rotation, position; then the reference.
    std::vector<int> index;
    for (const int at : {place.at + 3, place.at, reference.at, reference.at + 3}) {
      for (int i = 0; i < 3; ++i) index.push_back(at + i);
    }
    const RelativeRows J = relative_to_tag(place.tag->X_WT, reference.tag->X_WT);
    const Eigen::Matrix<double, 12, 12> joint = P_(index, index);
    const Eigen::Matrix<double, 6, 6> covariance = J * joint * J.transpose();
    position2 += covariance.topLeftCorner<3, 3>().trace();
    rotation2 += covariance.bottomRightCorner<3, 3>().trace();
    ++out.tags;
  }
  if (out.tags == 0) return out;
  out.position_m = std::sqrt(position2 / out.tags);
  out.rotation_rad = std::sqrt(rotation2 / out.tags);
  return out;
}

}  // namespace fiducap::bound
