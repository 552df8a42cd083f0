#include "estimation/rcars/state.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

namespace fiducap::rcars {

namespace {

void add_term(std::vector<Term>& terms, int at, const Matrix6d& J) {
  const auto same = std::ranges::find(terms, at, &Term::at);
  if (same == terms.end()) return terms.push_back({at, J});
  same->J += J;
}

/// [A B; 0 A]
Matrix6d upper(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
  Matrix6d out;
  out << A, B, Eigen::Matrix3d::Zero(), A;
  return out;
}

void add_error(Pose& X, const Vector6d& error) {
  X.p += error.head<3>();
  X.q = (exp_so3(error.tail<3>()) * X.q).normalized();
}

}  // namespace

Matrix6d LinearPose::by(int at) const {
  const auto found = std::ranges::find(terms, at, &Term::at);
  return found == terms.end() ? Matrix6d(Matrix6d::Zero()) : found->J;
}

LinearPose operator*(const LinearPose& X_AB, const LinearPose& X_BC) {
  const Eigen::Matrix3d R_AB = X_AB.X.rotation();
  const Matrix6d by_first = upper(Eigen::Matrix3d::Identity(), -skew(R_AB * X_BC.X.p));
  const Matrix6d by_second = upper(R_AB, Eigen::Matrix3d::Zero());
  LinearPose X_AC{X_AB.X * X_BC.X};
  for (const Term& term : X_AB.terms) add_term(X_AC.terms, term.at, by_first * term.J);
  for (const Term& term : X_BC.terms) add_term(X_AC.terms, term.at, by_second * term.J);
  return X_AC;
}

LinearPose inverse(const LinearPose& X_AB) {
  const Eigen::Matrix3d R_BA = X_AB.X.rotation().transpose();
  const Matrix6d by_pose = -upper(R_BA, R_BA * skew(X_AB.X.p));
  LinearPose X_BA{X_AB.X.inverse()};
  for (const Term& term : X_AB.terms) X_BA.terms.push_back({term.at, by_pose * term.J});
  return X_BA;
}

std::optional<std::size_t> State::find(int tag_id) const {
  const auto found = std::ranges::find(tags, tag_id, &Tag::tag_id);
  if (found == tags.end()) return std::nullopt;
  return static_cast<std::size_t>(found - tags.begin());
}

LinearPose State::X_BW() const { return {{q.conjugate(), -r}, {{kR, -Matrix6d::Identity()}}}; }

LinearPose State::X_BV(int camera) const {
  return {cameras[static_cast<std::size_t>(camera)], {{camera_at(camera), Matrix6d::Identity()}}};
}

LinearPose State::X_VT(std::size_t tag) const {
  return {tags[tag].X_VT, {{tag_at(tag), Matrix6d::Identity()}}};
}

LinearPose State::X_WT(std::size_t tag) const { return inverse(X_BW()) * X_BV(0) * X_VT(tag); }

void State::add_error(const Eigen::VectorXd& error) {
  r += error.segment<3>(kR);
  q = (q * exp_so3(error.segment<3>(kQ))).normalized();
  v += error.segment<3>(kV);
  b_f += error.segment<3>(kBf);
  b_w += error.segment<3>(kBw);
  int at = kBodySize;
  for (Pose& X_BV : cameras) rcars::add_error(X_BV, error.segment<6>(std::exchange(at, at + 6)));
  for (Tag& tag : tags) rcars::add_error(tag.X_VT, error.segment<6>(std::exchange(at, at + 6)));
}

void State::redefine(int at, const std::vector<Term>& terms, const Matrix6d& noise) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(6, P.cols());
  for (const Term& term : terms) rows += term.J * P.middleRows<6>(term.at);
  Matrix6d own = noise;
  for (const Term& term : terms) own += rows.middleCols<6>(term.at) * term.J.transpose();
  rows.middleCols<6>(at) = own;
  P.middleRows<6>(at) = rows;
  P.middleCols<6>(at) = rows.transpose();
}

Matrix6d State::covariance_of(const LinearPose& pose) const {
  Matrix6d out = Matrix6d::Zero();
  for (const Term& a : pose.terms)
    for (const Term& b : pose.terms) out += a.J * P.block<6, 6>(a.at, b.at) * b.J.transpose();
  return out;
}

BodyEstimate State::body() const {
  const LinearPose X_WB = inverse(X_BW());
  const Eigen::Matrix3d R = q.toRotationMatrix();
  BodyEstimate out{.at = time, .X_WB = X_WB.X, .v_WB = R * v, .bias_f = b_f, .bias_w = b_w};
  BodyMatrix J = BodyMatrix::Identity();  // the blocks of both have the same order
  J.topLeftCorner<6, 6>() = X_WB.by(kR);
  J.block<3, 3>(kV, kV) = R;
  J.block<3, 3>(kV, kQ) = -R * skew(v);
  out.covariance = J * P.topLeftCorner<kBodySize, kBodySize>() * J.transpose();
  return out;
}

double correct(State& x, const Eigen::VectorXd& y, const Eigen::MatrixXd& PHt,
               const Eigen::MatrixXd& S) {
  const Eigen::LLT<Eigen::MatrixXd> L(S);
  const Eigen::MatrixXd W = L.matrixL().solve(PHt.transpose());  // K = Wᵀ L⁻¹
  const Eigen::VectorXd whitened = L.matrixL().solve(y);
  x.P.selfadjointView<Eigen::Lower>().rankUpdate(W.transpose(), -1.0);
  x.P.triangularView<Eigen::StrictlyUpper>() = x.P.transpose();
  x.add_error(W.transpose() * whitened);
  return whitened.squaredNorm();
}

}  // namespace fiducap::rcars
