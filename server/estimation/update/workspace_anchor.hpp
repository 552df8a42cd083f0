#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/filter/matrix6.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// Covariance of a body's pose due to bent paper: the tag that defines W is 0.17° (1-sigma per
/// axis) off its assumed plane, as one of 0.16 m with a bow of 0.25 mm, and W rotates about it.
/// @param p_TB_W  from the print to the body, W axes, m
/// @return covariance of (position, m; rotation vector, rad), both W axes
[[nodiscard]] inline Matrix6d bend_of_print(const Eigen::Vector3d& p_TB_W) {
  constexpr double kBend_rad = 3e-3;
  Eigen::Matrix<double, 6, 3> turn;
  turn << -skew(p_TB_W), Eigen::Matrix3d::Identity();
  return kBend_rad * kBend_rad * turn * turn.transpose();
}

/// A tag that is both in the filter's state and in the map.
struct MapLink {
  int tag_id{};
  const KnownTag* map{};
  int sightings{};  ///< By this filter.
};

/// Finds the tag by which a filter in its own axes redefines them as the map's workspace.
///
/// Each link is tried on a copy: it redefines the axes, its pose is fused, and the other links are
/// compared with the map by the joint covariance. The link with most agreeing others is selected,
/// if these are more than half: a misread id does not anchor a body.
/// @param links  most seen first; replaced by those that agree, the selected one first
/// @param level  gravity defines the vertical
/// @return whether one was found
/// @tparam State  `find(tag_id)`, with the free functions `anchor_local_to_known`, `fuse_prior` and
///                `tag_in_workspace`
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
      return squared_distance(apart, S) < kGate;  // rejects NaN as well
    };
    (void)anchor_local_to_known(trial, index(links[i]), links[i].map->X_WT, level);
    if (!agrees(links[i])) continue;  // its tilt against gravity
    fuse_prior(trial, index(links[i]), *links[i].map);
    std::vector<MapLink> agreeing{links[i]};
    for (std::size_t k = 0; k < links.size(); ++k)
      if (k != i && agrees(links[k])) agreeing.push_back(links[k]);
    if (agreeing.size() > best.size()) best = std::move(agreeing);
  }
  if (2 * best.size() <= links.size()) return false;
  links = std::move(best);
  return true;
}

/// Defines the workspace W of one filter, once: by a tag of the map, by a surveyed tag or, when the
/// map has none, by the reference tag or the first one. Afterwards that tag is estimated like any
/// other.
///
/// Functions that define W return X_new_old: earlier poses become X_new = X_new_old X_old.
template <class Coordinates>
class WorkspaceAnchor final {
 public:
  /// @param level  gravity defines the vertical
  WorkspaceAnchor(const WorkspaceGauge& gauge, bool level) : gauge_(gauge), level_(level) {}

  void forget() {
    is_anchored_ = false;
    defined_by_.reset();
    heading_rule_.reset();
  }
  /// The tag has left the state.
  void forget_tag(int tag_id) {
    if (defined_by_ == tag_id) defined_by_.reset();
  }
  /// From now on the map defines W.
  void give_to_map() { defined_by_.reset(); }
  [[nodiscard]] bool is_anchored() const { return is_anchored_; }
  /// The tag of the state that defines W; nullopt: the map, or a removed tag.
  [[nodiscard]] std::optional<int> defined_by() const { return defined_by_; }

  /// By a tag with a pose in W, seen at X_VT; the pose of W is uncertain until the next update.
  std::optional<Pose> by_sighting(Coordinates& coordinates, int camera, const Pose& X_VT,
                                  const Pose& X_WT) {
    if (is_anchored_) return std::nullopt;
    is_anchored_ = true;
    return anchor_to_known(coordinates.state(), camera, X_VT, X_WT, level_);
  }

  /// By tags of the state that are in the map by now.
  /// @param gives_tags  the tags become the map's, one by one
  std::optional<Pose> by_own_tags(Coordinates& coordinates, std::span<const KnownTag> known,
                                  bool gives_tags) {
    if (is_anchored_) return std::nullopt;
    auto& state = coordinates.state();
    std::vector<MapLink> links;
    for (const KnownTag& tag : known) {
      const int own = state.find(tag.tag_id);
      if (own < 0) continue;
      links.push_back({tag.tag_id, &tag, state.tags[static_cast<std::size_t>(own)].sightings});
    }
    if (links.empty()) return std::nullopt;
    std::ranges::stable_sort(links, std::greater{}, &MapLink::sightings);
    if (!find_agreeing_links(state, level_, links)) return std::nullopt;
    const auto index = [&](const MapLink& link) {
      return static_cast<std::size_t>(state.find(link.tag_id));
    };
    is_anchored_ = true;
    const Pose shift =
        anchor_local_to_known(state, index(links.front()), links.front().map->X_WT, level_);
    if (gives_tags)
      for (const MapLink& link : links) coordinates.give_to_map(index(link), *link.map);
    return shift;
  }

  /// By an own tag, if allowed. Once defined: removes the slip of linearisation.
  std::optional<Pose> by_definition(Coordinates& coordinates, bool may_define) {
    auto& state = coordinates.state();
    if (defined_by_) {
      const int tag = state.find(*defined_by_);
      if (tag >= 0) coordinates.keep_defined(static_cast<std::size_t>(tag), *heading_rule_);
      return std::nullopt;
    }
    if (is_anchored_ || !may_define || state.tags.empty()) return std::nullopt;
    const int wanted = gauge_.reference_tag ? state.find(*gauge_.reference_tag) : 0;
    if (wanted < 0) return std::nullopt;
    const auto tag = static_cast<std::size_t>(wanted);
    WorkspaceGauge gauge = gauge_;
    if (!level_ && gauge_.stands_by_floor()) {
      gauge.X_WT = upright_by_floor(state, tag);
      if (!gauge.X_WT) return std::nullopt;
    }
    heading_rule_ = make_heading_rule(gauge, tag_in_workspace(state, tag).X_WT.q);
    defined_by_ = state.tags[tag].tag_id;
    is_anchored_ = true;
    return anchor_to_reference(state, tag, *heading_rule_, level_);
  }

 private:
  // The vertical is not corrected later: sightings of a floor tag before it is used.
  static constexpr int kSightingsOfFloor = 20;

  /// Level pose of the tag by the floor tags; nullopt: not all of them are known.
  template <class State>
  [[nodiscard]] std::optional<Pose> upright_by_floor(const State& state, std::size_t tag) const {
    std::vector<Pose> floor;
    for (const int tag_id : gauge_.floor_tags) {
      const int own = state.find(tag_id);
      if (own < 0) return std::nullopt;
      const auto index = static_cast<std::size_t>(own);
      if (state.tags[index].sightings < kSightingsOfFloor) return std::nullopt;
      floor.push_back(tag_in_workspace(state, index).X_WT);
    }
    const auto up = up_by_floor(floor);
    if (!up) return std::nullopt;
    return Pose{upright_attitude(tag_in_workspace(state, tag).X_WT.q, *up),
                Eigen::Vector3d::Zero()};
  }

  WorkspaceGauge gauge_;
  bool level_;
  bool is_anchored_{false};
  std::optional<int> defined_by_;
  std::optional<HeadingRule> heading_rule_;
};

}  // namespace fiducap
