#include "estimation/rcars/equations.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace fiducap::rcars {

namespace {

LinearPose given(const Pose& X) { return {X, {{kOutside, Matrix6d::Identity()}}}; }

/// The tag in the axes of `camera`.
LinearPose predicted(const State& x, int camera, const Sighting& tag) {
  const LinearPose X_BT = tag.known != nullptr ? x.X_BW() * given(tag.known->X_WT)
                                               : x.X_BV(0) * x.X_VT(*x.find(tag.seen->tag_id));
  return inverse(x.X_BV(camera)) * X_BT;
}

/// Sets r and q. @return X_WnewWold
Pose redefine_body(State& x, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB_B) {
  const Pose X_BW = x.X_BW().X;
  x.q = q_WB.normalized();
  x.r = p_WB_B;
  return x.X_BW().X.inverse() * X_BW;
}

}  // namespace

Innovation innovation(const State& x, const View& view, const Sighting& tag) {
  const LinearPose X_VT = predicted(x, view.camera, tag);
  const CornerResidual corners = corner_residual(*tag.seen, X_VT.X, view.model);
  Innovation out{.y = corners.y, .H = {}, .in_front = corners.in_front};
  out.R.diagonal().setConstant(view.noise_px * view.noise_px);
  for (const Term& term : X_VT.terms) {
    const Matrix86d H = corners.H * term.J;
    if (term.at == kOutside)
      out.R += H * tag.known->covariance * H.transpose();
    else
      out.H.emplace_back(term.at, H);
  }
  return out;
}

std::vector<bool> update(State& x, const View& view, std::span<const Sighting> tags, double gate,
                         UpdateReport& report) {
  std::vector<Innovation> used;
  Eigen::MatrixXd PHt(x.size(), 8 * tags.size());
  std::vector<bool> accepted(tags.size());
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const Innovation y = innovation(x, view, tags[i]);
    auto own = PHt.middleCols<8>(8 * static_cast<Eigen::Index>(used.size()));
    own.setZero();
    Matrix8d S = y.R;
    for (const auto& [at, H] : y.H) own += x.P.middleCols<6>(at) * H.transpose();
    for (const auto& [at, H] : y.H) S += H * own.middleRows<6>(at);
    accepted[i] = y.in_front && y.y.dot(S.llt().solve(y.y)) < gate;
    if (accepted[i]) used.push_back(y);
  }
  const auto rows = 8 * static_cast<Eigen::Index>(used.size());
  PHt.conservativeResize(Eigen::NoChange, rows);
  report.tags_used = static_cast<int>(used.size());
  report.tags_rejected = static_cast<int>(tags.size() - used.size());
  if (used.empty()) return accepted;
  Eigen::VectorXd y(rows);
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(rows, rows);
  for (Eigen::Index row = 0; row < rows; row += 8) {
    const Innovation& own = used[static_cast<std::size_t>(row / 8)];
    y.segment<8>(row) = own.y;
    S.block<8, 8>(row, row) = own.R;
    for (const auto& [at, H] : own.H) S.middleRows<8>(row) += H * PHt.middleRows<6>(at);
  }
  report.nis = correct(x, y, PHt, S);
  report.nis_dof = static_cast<int>(rows);
  double squares = 0;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const Innovation after = innovation(x, view, tags[i]);
    if (after.in_front)
      report.name_fit({tags[i].seen->tag_id, std::sqrt(after.y.squaredNorm() / 4)});
    if (accepted[i]) squares += after.y.squaredNorm();
    if (accepted[i] && tags[i].known != nullptr) report.name_fitting(tags[i].seen->tag_id);
  }
  report.reprojection_px = std::sqrt(squares / (4.0 * report.tags_used));
  return accepted;
}

void augment(State& x, const View& view, const TagObservation& seen, const Pose& X_VT) {
  const Matrix86d H = corner_residual(seen, X_VT, view.model).H / view.noise_px;
  const Matrix6d own = (H.transpose() * H).llt().solve(Matrix6d::Identity());
  const LinearPose X_V0T = inverse(x.X_BV(0)) * x.X_BV(view.camera) * given(X_VT);
  const Matrix6d turn = X_V0T.by(kOutside);
  std::vector<Term> terms = X_V0T.terms;
  std::erase_if(terms, [](const Term& term) { return term.at == kOutside; });
  x.tags.push_back({.tag_id = seen.tag_id, .edge_m = seen.edge_m, .X_VT = X_V0T.X});
  x.P.conservativeResizeLike(Eigen::MatrixXd::Zero(x.size(), x.size()));
  x.redefine(x.tag_at(x.tags.size() - 1), terms, turn * own * turn.transpose());
}

void fuse_prior(State& x, std::size_t tag, const KnownTag& prior) {
  const LinearPose X_WT = x.X_WT(tag);
  Vector6d y;
  y << prior.X_WT.p - X_WT.X.p, log_so3(prior.X_WT.q * X_WT.X.q.conjugate());
  Eigen::MatrixXd PHt = Eigen::MatrixXd::Zero(x.size(), 6);
  for (const Term& term : X_WT.terms) PHt += x.P.middleCols<6>(term.at) * term.J.transpose();
  correct(x, y, PHt, prior.covariance + x.covariance_of(X_WT));
}

Pose define_by_reference(State& x, std::size_t tag, const HeadingRule& rule) {
  const LinearPose X_BT = x.X_BV(0) * x.X_VT(tag);
  const Eigen::Matrix3d R_WB = x.q.toRotationMatrix();
  // The heading ψ is that of the tag's level axis h, which rotates with the tag (δφ in B axes).
  const Eigen::Vector3d h = R_WB * (X_BT.X.q * Eigen::Vector3d::Unit(rule.axis));
  const Eigen::RowVector3d psi_by_h =
      Eigen::RowVector3d(-h.y(), h.x(), 0) / h.head<2>().squaredNorm();
  const Eigen::RowVector3d psi_by_turn = -psi_by_h * skew(h) * R_WB;
  const Eigen::Quaterniond q = turn_to_heading(rule, x.q * X_BT.X.q) * x.q;
  const Eigen::Vector3d up_B = q.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d N = up_B * psi_by_turn;
  const Eigen::Vector3d place_B = q.conjugate() * rule.X_WT.p;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  Matrix6d by_body;
  Matrix6d by_tag;
  by_body << zero, skew(place_B) * (I - N), zero, I - N;
  by_tag << -I, -skew(place_B) * N, zero, -N;
  std::vector<Term> terms{{kR, by_body}};
  for (const Term& term : X_BT.terms) terms.push_back({term.at, by_tag * term.J});
  x.redefine(kR, terms, Matrix6d::Zero());
  return redefine_body(x, q, place_B - X_BT.X.p);
}

Pose define_by_known(State& x, int camera, const Pose& X_VT, const Pose& X_WT) {
  const Pose X_BT = x.X_BV(camera).X * X_VT;
  const Eigen::Quaterniond q = turn_closest(X_WT.q, x.q * X_BT.q) * x.q;
  const Eigen::Vector3d up_B = q.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d about_up = up_B * up_B.transpose();
  Matrix6d tilt = Matrix6d::Zero();
  tilt.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() - about_up;
  Matrix6d noise = Matrix6d::Zero();
  noise.diagonal().head<3>().setConstant(kUnknownPosition_m * kUnknownPosition_m);
  noise.bottomRightCorner<3, 3>() = kUnknownAngle_rad * kUnknownAngle_rad * about_up;
  x.redefine(kR, {{kR, tilt}}, noise);
  return redefine_body(x, q, q.conjugate() * X_WT.p - X_BT.p);
}

}  // namespace fiducap::rcars
