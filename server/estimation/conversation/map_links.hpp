#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Cholesky>

#include "base/so3.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// A tag that the filter's own state and the map both have: what links one to the other.
struct MapLink {
  int tag_id{};
  const KnownTag* map{};
  int sightings{};  ///< By this filter.
};

/// Finds the tag by which a filter in axes of its own may re-define them as the map's workspace.
///
/// Each link in turn is tried on a copy: the axes are re-defined by it, its place is fused, and the
/// other links are compared with the map on the joint covariance. The one that most others agree
/// with wins, if those are more than half: one misread id anchors no body.
/// @param links  most seen first; replaced by those that agree, the winner first
/// @param level  gravity says what is up
/// @return whether there is one
///
/// State: `find(tag_id)`, and next to it `anchor_local_to_known(State&, tag, X_WT, level)`,
/// `fuse_prior(State&, tag, KnownTag)` and `tag_in_workspace(const State&, tag)`.
template <class State>
[[nodiscard]] bool find_agreeing_links(const State& state, bool level,
                                       std::vector<MapLink>& links) {
  constexpr std::size_t kMostTried = 8;
  static const double kGate = chi_square_quantile(6, 0.9999);
  std::vector<MapLink> best;
  for (std::size_t i = 0; i < std::min(links.size(), kMostTried); ++i) {
    State trial = state;
    const auto index = [&](const MapLink& link) {
      return static_cast<std::size_t>(trial.find(link.tag_id));
    };
    const auto agrees = [&](const MapLink& link) {
      const KnownTag own = tag_in_workspace(trial, index(link));
      Vector6d apart;
      apart << link.map->X_WT.p - own.X_WT.p, log_so3(link.map->X_WT.q * own.X_WT.q.conjugate());
      const Matrix6d S = own.covariance + link.map->covariance;
      return apart.dot(S.ldlt().solve(apart)) < kGate;  // NaN stays out as well
    };
    (void)anchor_local_to_known(trial, index(links[i]), links[i].map->X_WT, level);
    if (!agrees(links[i])) continue;  // its tilt against gravity
    fuse_prior(trial, index(links[i]), *links[i].map);
    std::vector<MapLink> agreeing{links[i]};
    for (std::size_t k = 0; k < links.size(); ++k) {
      if (k != i && agrees(links[k])) agreeing.push_back(links[k]);
    }
    if (agreeing.size() > best.size()) best = std::move(agreeing);
  }
  if (2 * best.size() <= links.size()) return false;
  links = std::move(best);
  return true;
}

}  // namespace fiducap
