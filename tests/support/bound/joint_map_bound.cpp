#include "support/bound/joint_map_bound.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "support/bound/linearisation.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::bound {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

const RecordedTag& tag_of(std::span<const RecordedTag> tags, int tag_id) {
  const auto found = std::ranges::find(tags, tag_id, &RecordedTag::tag_id);
  FIDUCAP_ASSERT(found != tags.end());
  return *found;
}

/// Place of all tags (3n) by a shift and a turn about the vertical through `middle`.
MatrixXd places_by_gauge(std::span<const RecordedTag> tags, const Vector3d& middle) {
  MatrixXd H(3 * static_cast<Index>(tags.size()), 4);
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const Vector3d arm = tags[i].X_WT.p - middle;
    H.middleRows<3>(3 * static_cast<Index>(i)) << Eigen::Matrix3d::Identity(),
        Vector3d::UnitZ().cross(arm);
  }
  return H;
}

Vector3d middle_of(std::span<const RecordedTag> tags) {
  Vector3d middle = Vector3d::Zero();
  for (const RecordedTag& tag : tags) middle += tag.X_WT.p / static_cast<double>(tags.size());
  return middle;
}

/// Errors of all tags (6n: place, rotation) by the same.
MatrixXd errors_by_gauge(std::span<const RecordedTag> tags) {
  const MatrixXd H = places_by_gauge(tags, middle_of(tags));
  MatrixXd G = MatrixXd::Zero(2 * H.rows(), 4);
  for (Index i = 0; i < H.rows() / 3; ++i) {
    G.middleRows<3>(6 * i) = H.middleRows<3>(3 * i);
    G(6 * i + 5, 3) = 1;
  }
  return G;
}

MatrixXd inverse_of(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> llt(A);
  FIDUCAP_ASSERT(llt.info() == Eigen::Success);
  const MatrixXd out = llt.solve(MatrixXd::Identity(A.rows(), A.cols()));
  return 0.5 * (out + out.transpose());
}

/// Λ' of the header.
MatrixXd information_without_gauge(const TagsCovariance& body, std::span<const RecordedTag> tags) {
  std::vector<RecordedTag> own;
  for (const int id : body.ids) own.push_back(tag_of(tags, id));
  const MatrixXd information = inverse_of(body.P);
  const MatrixXd LG = information * errors_by_gauge(own);
  const Eigen::Matrix4d GLG = errors_by_gauge(own).transpose() * LG;
  return information - LG * GLG.ldlt().solve(LG.transpose());
}

/// Bodies that are connected to a tag, and their tags.
struct Component {
  std::vector<const TagsCovariance*> bodies;
  std::set<int> ids;
};
Component component_of(int tag_id, std::span<const TagsCovariance> bodies) {
  Component out;
  out.ids.insert(tag_id);
  for (bool grows = true; grows;) {
    grows = false;
    for (const TagsCovariance& body : bodies) {
      const bool is_in = std::ranges::find(out.bodies, &body) != out.bodies.end();
      if (is_in || std::ranges::none_of(body.ids, [&](int id) { return out.ids.contains(id); }))
        continue;
      out.bodies.push_back(&body);
      out.ids.insert(body.ids.begin(), body.ids.end());
      grows = true;
    }
  }
  return out;
}

Index row_of(std::span<const RecordedTag> tags, int tag_id) {
  return 6 * (&tag_of(tags, tag_id) - tags.data());
}

/// Place and heading of the reference tag by all errors (4 × 6n).
MatrixXd gauge_rows(std::span<const RecordedTag> tags, int reference_tag) {
  const Eigen::Quaterniond& q_WT = tag_of(tags, reference_tag).X_WT.q;
  const Index at = row_of(tags, reference_tag);
  MatrixXd C = MatrixXd::Zero(4, 6 * static_cast<Index>(tags.size()));
  C.block<3, 3>(0, at).setIdentity();
  C.block<1, 3>(3, at + 3) = heading_row(q_WT, heading_axis(q_WT));
  return C;
}

}  // namespace

JointMap joint_map_bound(std::span<const RecordedTag> tags, int reference_tag,
                         std::span<const TagsCovariance> bodies) {
  const Component component = component_of(reference_tag, bodies);
  FIDUCAP_ASSERT(!component.bodies.empty());
  JointMap out;
  for (const int id : component.ids) out.tags.push_back(tag_of(tags, id));
  const Index size = 6 * static_cast<Index>(out.tags.size());
  MatrixXd information = MatrixXd::Zero(size, size);
  for (const TagsCovariance* body : component.bodies) {
    std::vector<int> rows;
    for (const int id : body->ids)
      for (int i = 0; i < 6; ++i) rows.push_back(static_cast<int>(row_of(out.tags, id)) + i);
    information +=
        propagated(selection(rows, size).transpose(), information_without_gauge(*body, tags));
  }
  // Terms of any weight fix the gauge (the weight of the reference tag's own numbers, for
  // conditioning); then their uncertainty is removed.
  const MatrixXd C = gauge_rows(out.tags, reference_tag);
  const Index at = row_of(out.tags, reference_tag);
  Eigen::Vector4d weight;
  weight << Vector3d::Constant(information.diagonal().segment<3>(at).mean()),
      information.diagonal().segment<3>(at + 3).mean();
  information += C.transpose() * weight.asDiagonal() * C;
  const MatrixXd G = errors_by_gauge(out.tags);
  const MatrixXd S = MatrixXd::Identity(size, size) - G * (C * G).inverse() * C;
  out.P = S * inverse_of(information) * S.transpose();
  return out;
}

MapFigures figures_of(const JointMap& map, std::span<const int> ids) {
  std::vector<RecordedTag> tags;
  std::vector<int> rows;
  for (std::size_t i = 0; i < map.tags.size(); ++i) {
    if (std::find(ids.begin(), ids.end(), map.tags[i].tag_id) == ids.end()) continue;
    tags.push_back(map.tags[i]);
    for (int k = 0; k < 3; ++k) rows.push_back(6 * static_cast<int>(i) + k);
  }
  MapFigures out;
  out.tags = static_cast<int>(tags.size());
  if (tags.empty()) return out;
  const MatrixXd P = marginal(map.P, rows);
  const MatrixXd H = places_by_gauge(tags, middle_of(tags));
  // A projection Π = I − H H⁺: tr(Π P Πᵀ) = tr(P) − tr(H⁺ P H). A single tag has no heading.
  const MatrixXd HtH = H.transpose() * H;
  const Index numbers = HtH(3, 3) > 0 ? 4 : 3;
  const MatrixXd fitted = HtH.topLeftCorner(numbers, numbers)
                              .ldlt()
                              .solve((H.transpose() * P * H).topLeftCorner(numbers, numbers));
  out.raw_m = std::sqrt(P.trace() / out.tags);
  out.level_m = std::sqrt((P.trace() - fitted.trace()) / out.tags);
  return out;
}

}  // namespace fiducap::bound
