#pragma once

#include <span>

#include <Eigen/Core>

#include "base/pose.hpp"

namespace fiducap {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A tag whose place in the workspace is an input of the filter, not its state (RCARS II-D4, last
/// paragraph).
struct KnownTag {
  int tag_id{};
  double edge_m{};
  Pose X_WT;
  /// Position (m, W axes) then attitude (rotation vector in W axes, q_WT = exp(δ) q̂_WT). Zero:
  /// exact.
  Matrix6d covariance{Matrix6d::Zero()};

  [[nodiscard]] bool is_exact() const { return covariance.isZero(0); }
};

struct KnownMap;

/// What the shared map tells one body's filter before an image. The map owns the workspace: a
/// filter that stands in it never re-defines it.
struct MapKnowledge {
  /// Places in the workspace; tags that are not in the image are ignored.
  std::span<const KnownTag> tags{};
  /// There is no workspace yet, and this body may make it out of its tags (the reference tag, or
  /// the first one when none is named). False: it waits, not anchored, for a tag of the map.
  bool may_define_workspace{true};
  /// The whole of it, when its tags hang together; nullptr: each tag of `tags` stands alone.
  const KnownMap* whole{};
  /// Who the body is in it.
  int body_id{-1};
};

}  // namespace fiducap
