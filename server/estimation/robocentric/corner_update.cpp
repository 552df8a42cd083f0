#include "estimation/robocentric/corner_update.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "base/assert.hpp"
#include "base/so3.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: the block names are the subject of this file

namespace {

constexpr int kRows = 8;
using Matrix83d = Eigen::Matrix<double, 8, 3>;

/// Tag in B axes by the state, and its derivative towards what it depends on.
Pose tag_in_body(const FilterState& state, const TagToUse& tag) {
  if (tag.local >= 0) return state.X_BV[0] * state.tags[static_cast<std::size_t>(tag.local)].X_VT;
  return state.X_WB().inverse() * tag.known->X_WT;
}

/// Corner noise plus the uncertainty of the given place, which no state block carries.
Eigen::Matrix<double, 8, 8> noise_of(const FilterState& state, const TagToUse& tag, const Matrix86d& H_BT, double noise_px) {
  Eigen::Matrix<double, 8, 8> R = Eigen::Matrix<double, 8, 8>::Identity() * noise_px * noise_px;
  if (tag.local < 0) {
    Matrix6d B_from_W = Matrix6d::Zero();
    B_from_W.topLeftCorner<3, 3>() = state.q_WB.conjugate().toRotationMatrix();
    B_from_W.bottomRightCorner<3, 3>() = B_from_W.topLeftCorner<3, 3>();
    const Matrix86d H = H_BT * B_from_W;
    R.noalias() += H * tag.known->covariance * H.transpose();
  }
  return R;
}

void add_body_blocks(TagMeasurement& m, const FilterState& state, const Matrix86d& H_BT, const Pose& X_BT) {
  const Matrix83d H_p = H_BT.leftCols<3>();
  const Matrix83d H_q = H_BT.rightCols<3>();
  m.add(kPosition, -H_p);
  m.add(kAttitude, H_p * skew(X_BT.p + state.p_WB_B) - H_q);
}

void add_tag_blocks(TagMeasurement& m, const FilterState& state, int local, const Matrix86d& H_BT) {
  const Pose& X_BV = state.X_BV[0];
  const Eigen::Matrix3d R_BV = X_BV.rotation();
  const Eigen::Vector3d arm_B = X_BV.q * state.tags[static_cast<std::size_t>(local)].X_VT.p;
  const Matrix83d H_p = H_BT.leftCols<3>();
  const Matrix83d H_q = H_BT.rightCols<3>();
  m.add(state.tag_at(static_cast<std::size_t>(local)), H_p * R_BV);
  m.add(state.tag_at(static_cast<std::size_t>(local)) + 3, H_q * R_BV);
  m.add(extrinsics(0), H_p);
  m.add(extrinsics(0) + 3, H_q - H_p * skew(arm_B));
}

}  // namespace

void TagMeasurement::add(int at, const Matrix83d& H) {
  for (std::size_t i = 0; i < block_count; ++i) {
    if (blocks[i].at == at) {
      blocks[i].H += H;
      return;
    }
  }
  FIDUCAP_ASSERT(block_count < kMaxBlocks);
  blocks[block_count++] = {at, H};
}

Pose predicted_tag(const FilterState& state, int camera, const TagToUse& tag) {
  if (tag.local >= 0 && camera == 0) return state.tags[static_cast<std::size_t>(tag.local)].X_VT;
  return state.X_BV[static_cast<std::size_t>(camera)].inverse() * tag_in_body(state, tag);
}

TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model, const TagToUse& tag,
                       double corner_noise_px) {
  TagMeasurement m;
  m.tag_id = tag.seen->tag_id;
  const CornerResidual residual = corner_residual(*tag.seen, predicted_tag(state, camera, tag), model);
  m.in_front = residual.in_front;
  m.y = residual.y;
  m.R = Eigen::Matrix<double, 8, 8>::Identity() * corner_noise_px * corner_noise_px;
  if (!m.in_front) return m;
  if (tag.local >= 0 && camera == 0) {
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)), residual.H.leftCols<3>());
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)) + 3, residual.H.rightCols<3>());
    return m;
  }
  // Through the body: X_VT = X_BV⁻¹ X_BT.
  const Pose& X_BV = state.X_BV[static_cast<std::size_t>(camera)];
  const Eigen::Matrix3d R_VB = X_BV.rotation().transpose();
  const Pose X_BT = tag_in_body(state, tag);
  Matrix86d H_BT;
  H_BT << residual.H.leftCols<3>() * R_VB, residual.H.rightCols<3>() * R_VB;
  m.add(extrinsics(camera), -H_BT.leftCols<3>());
  m.add(extrinsics(camera) + 3, H_BT.leftCols<3>() * skew(X_BT.p - X_BV.p) - H_BT.rightCols<3>());
  if (tag.local >= 0) {
    add_tag_blocks(m, state, tag.local, H_BT);
  } else {
    add_body_blocks(m, state, H_BT, X_BT);
    m.R = noise_of(state, tag, H_BT, corner_noise_px);
  }
  return m;
}

void CornerUpdate::build(const FilterState& state, int camera, const CameraModel& model,
                         std::span<const TagToUse> tags, double corner_noise_px) {
  measurements_.clear();
  for (const TagToUse& tag : tags) measurements_.push_back(measure(state, camera, model, tag, corner_noise_px));
}

void CornerUpdate::keep_inside_gate(const FilterState& state, double gate, std::vector<bool>& accepted) {
  const auto P = state.P();
  used_.clear();
  accepted.assign(measurements_.size(), false);
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    const TagMeasurement& m = measurements_[i];
    if (!m.in_front) continue;
    Eigen::Matrix<double, 8, 8> S = m.R;
    for (std::size_t a = 0; a < m.block_count; ++a) {
      for (std::size_t b = 0; b < m.block_count; ++b) {
        S.noalias() += m.blocks[a].H * P.block<3, 3>(m.blocks[a].at, m.blocks[b].at) * m.blocks[b].H.transpose();
      }
    }
    const double distance = m.y.dot(S.ldlt().solve(m.y));
    if (!(distance < gate)) continue;  // NaN stays out as well
    accepted[i] = true;
    used_.push_back(i);
  }
}

void CornerUpdate::stack(const FilterState& state) {
  const auto P = state.P();
  const Eigen::Index n = state.size();
  const Eigen::Index rows = kRows * static_cast<Eigen::Index>(used_.size());
  if (PHt_.rows() < n || PHt_.cols() < rows) {
    PHt_.resize(n + n / 2, rows * 2);
    S_.resize(rows * 2, rows * 2);
    y_.resize(rows * 2);
    dx_.resize(n + n / 2);
  }
  auto PHt = PHt_.topLeftCorner(n, rows);
  auto S = S_.topLeftCorner(rows, rows);
  PHt.setZero();
  for (std::size_t k = 0; k < used_.size(); ++k) {
    const TagMeasurement& m = measurements_[used_[k]];
    const Eigen::Index at = kRows * static_cast<Eigen::Index>(k);
    y_.segment<kRows>(at) = m.y;
    for (std::size_t b = 0; b < m.block_count; ++b) {
      PHt.middleCols<kRows>(at).noalias() += P.middleCols<3>(m.blocks[b].at) * m.blocks[b].H.transpose();
    }
  }
  for (std::size_t k = 0; k < used_.size(); ++k) {
    const TagMeasurement& m = measurements_[used_[k]];
    const Eigen::Index at = kRows * static_cast<Eigen::Index>(k);
    S.middleRows<kRows>(at).setZero();
    for (std::size_t b = 0; b < m.block_count; ++b) {
      S.middleRows<kRows>(at).noalias() += m.blocks[b].H * PHt.middleRows<3>(m.blocks[b].at);
    }
    S.block<kRows, kRows>(at, at) += m.R;
  }
}

void CornerUpdate::refer_to(const FilterState& prior, const FilterState& state) {
  // Iterated Kalman filter: the innovation is taken back to the prior, H stays at the present point.
  const Eigen::VectorXd back = state.error_to(prior);
  for (TagMeasurement& m : measurements_) {
    for (std::size_t b = 0; b < m.block_count; ++b) m.y -= m.blocks[b].H * back.segment<3>(m.blocks[b].at);
  }
}

UpdateReport CornerUpdate::apply(FilterState& state, int camera, const CameraModel& model,
                                 std::span<const TagToUse> tags, const Options& options, std::vector<bool>& accepted) {
  UpdateReport report;
  const bool moves = options.iterations > 1 || options.start != nullptr;
  const FilterState prior = moves ? state : FilterState{};
  if (options.start != nullptr) state.copy_mean(*options.start);
  build(state, camera, model, tags, options.corner_noise_px);
  if (moves) refer_to(prior, state);
  keep_inside_gate(state, options.gate, accepted);
  report.tags_rejected = static_cast<int>(tags.size() - used_.size());
  if (used_.empty()) {
    if (moves) state.copy_mean(prior);
    return report;
  }
  const Eigen::Index n = state.size();
  const Eigen::Index rows = kRows * static_cast<Eigen::Index>(used_.size());
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    if (iteration > 0) {
      build(state, camera, model, tags, options.corner_noise_px);
      refer_to(prior, state);
    }
    stack(state);
    auto PHt = PHt_.topLeftCorner(n, rows);
    auto S = S_.topLeftCorner(rows, rows);
    auto y = y_.head(rows);
    auto dx = dx_.head(n);
    Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);  // in place: S becomes its Cholesky factor
    llt.matrixL().solveInPlace(y);
    if (iteration == 0) report.nis = y.squaredNorm();
    llt.matrixU().solveInPlace<Eigen::OnTheRight>(PHt);
    dx.noalias() = PHt * y;
    if (moves) state.copy_mean(prior);
    state.add_error(dx);
  }
  // P ← P − K S Kᵀ with K S^{1/2} = P Hᵀ S^{-T/2}: symmetric by construction, half the work of the product.
  auto P = state.P();
  P.template selfadjointView<Eigen::Lower>().rankUpdate(PHt_.topLeftCorner(n, rows), -1.0);
  P.template triangularView<Eigen::StrictlyUpper>() = P.transpose();

  report.tags_used = static_cast<int>(used_.size());
  report.nis_dof = static_cast<int>(rows);
  build(state, camera, model, tags, options.corner_noise_px);
  double squares = 0;
  for (const std::size_t i : used_) squares += measurements_[i].y.squaredNorm();
  report.reprojection_px = std::sqrt(squares / (4.0 * static_cast<double>(used_.size())));
  return report;
}

}  // namespace fiducap::robocentric
