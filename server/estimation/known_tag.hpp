#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/found_mismatch.hpp"

namespace fiducap {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A tag whose pose in the workspace is an input of the filter, not its state (RCARS II-D4, end).
struct KnownTag {
  int tag_id{};
  double edge_m{};
  Pose X_WT;
  /// Position (m, W axes), then attitude (rotation vector in W axes, q_WT = exp(δ) q̂_WT). Zero:
  /// exact.
  Matrix6d covariance{Matrix6d::Zero()};

  [[nodiscard]] bool is_exact() const { return covariance.isZero(0); }
};

/// Estimate of one tag by one body's filter. Input of mapping.
struct TagBelief {
  static constexpr int kWorkspace = 0;
  static constexpr int kOwnAxes = -1;

  KnownTag tag;
  int sightings{};
  Instant first_seen{};
  Instant last_seen{};
  /// Axes of `tag.X_WT`: the workspace, or those of a body that is not anchored yet.
  int component{kWorkspace};
};

/// Cross-covariance of two tags: the first's six numbers with the second's, as
/// KnownTag::covariance. first_id < second_id.
struct KnownPair {
  int first_id{};
  int second_id{};
  Matrix6d covariance{Matrix6d::Zero()};
};

/// All tags of the map with a pose in the workspace. Tags of one map share most of their error
/// (origin and heading of the whole, bends of a chain); it is given for tags seen together.
struct KnownMap {
  std::uint64_t revision{};      ///< Changes with the map.
  std::vector<KnownTag> tags;    ///< Sorted by id.
  std::vector<KnownPair> pairs;  ///< Sorted by both ids.
  /// The body whose images alone have made the map; nullopt: several, or an earlier session.
  std::optional<int> made_by{};
  /// Sorted by id: surveyed, or of a map without correlations.
  std::vector<KnownTag> uncorrelated;
  /// Tags found to have another size than configured; kAllPrints: all. Their poses are right.
  std::vector<int> wrong_prints;
  static constexpr int kAllPrints = -1;
  /// A parameter of a lens that was found to differ from the configured one.
  struct WrongLens {
    int body_id{};
    int camera{};
    FoundMismatch::Kind kind{};
  };
  std::vector<WrongLens> wrong_lenses;

  [[nodiscard]] const KnownTag* find(int tag_id) const {
    const KnownTag* found = find(tag_id, tags);
    return found != nullptr ? found : find(tag_id, uncorrelated);
  }
  /// Its error is joint with that of other tags.
  [[nodiscard]] bool is_joint(int tag_id) const { return find(tag_id, tags) != nullptr; }
  /// Cross-covariance of one tag's numbers (rows) with another's; nullopt: not known.
  [[nodiscard]] std::optional<Matrix6d> between(int row_id, int column_id) const {
    if (row_id > column_id) {
      const auto turned = between(column_id, row_id);
      return turned ? std::optional<Matrix6d>(turned->transpose()) : std::nullopt;
    }
    const auto key = std::pair(row_id, column_id);
    const auto ids = [](const KnownPair& pair) { return std::pair(pair.first_id, pair.second_id); };
    const auto at = std::ranges::lower_bound(pairs, key, {}, ids);
    if (at == pairs.end() || ids(*at) != key) return std::nullopt;
    return at->covariance;
  }

 private:
  static const KnownTag* find(int tag_id, const std::vector<KnownTag>& in) {
    const auto at = std::ranges::lower_bound(in, tag_id, {}, &KnownTag::tag_id);
    return at != in.end() && at->tag_id == tag_id ? &*at : nullptr;
  }
};

/// The map's knowledge for one image of one body. The map owns the workspace: an anchored filter
/// never redefines it.
struct MapKnowledge {
  /// Poses in the workspace; tags that are not in the image are ignored.
  std::span<const KnownTag> tags{};
  /// There is no workspace yet and this body may define it by one of its tags (the reference tag or
  /// the first one). False: the body waits for a tag of the map.
  bool may_define_workspace{true};
  /// The map with the correlations of its tags; nullptr: the tags are independent.
  const KnownMap* whole{};
  int body_id{-1};  ///< Id of the body in `whole`.
};

}  // namespace fiducap
