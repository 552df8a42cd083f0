#include "estimation/world/workspace_axes.hpp"

#include <algorithm>
#include <functional>
#include <vector>

#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/matrix6.hpp"
#include "estimation/world/tag_entry.hpp"

namespace fiducap {

namespace {
// Slip and sigma of the reference tag at which it redefines W: m and rad.
constexpr double kSlipped = 1e-6;
constexpr double kUnsure = 1e-5;
// The vertical is not corrected later: sightings of a floor tag before it is used.
constexpr int kSightingsOfFloor = 20;
constexpr std::size_t kMostTried = 8;

/// A tag that is both in the filter's state and in the map.
struct MapLink {
  int tag_id{};
  const KnownTag* map{};
  int sightings{};  ///< By this filter.
};

std::size_t index_of(const world::FilterState& state, int tag_id) {
  return static_cast<std::size_t>(state.find(tag_id));
}

/// Finds the tag by which a filter in its own axes redefines them as the map's workspace.
///
/// Each link is tried on a copy: it redefines the axes, its pose is fused, and the other links are
/// compared with the map by the joint covariance.
/// @param links  most seen first; replaced by those that agree, the selected one first
/// @return whether one was found
bool find_agreeing_links(const world::FilterState& state, bool level, std::vector<MapLink>& links) {
  static const double kGate = chi_square_quantile(6, 0.9999);
  std::vector<MapLink> best;
  for (std::size_t i = 0; i < std::min(links.size(), kMostTried); ++i) {
    world::FilterState trial = state;
    const auto agrees = [&](const MapLink& link) {
      const KnownTag own = tag_in_workspace(trial, index_of(trial, link.tag_id));
      Vector6d apart;
      apart << link.map->X_WT.p - own.X_WT.p, log_so3(link.map->X_WT.q * own.X_WT.q.conjugate());
      const Matrix6d S = own.covariance + link.map->covariance;
      return squared_distance(apart, S) < kGate;  // rejects NaN as well
    };
    const std::size_t tag = index_of(trial, links[i].tag_id);
    (void)anchor_local_to_known(trial, tag, links[i].map->X_WT, level);
    if (!agrees(links[i])) continue;  // its tilt against gravity
    fuse_prior(trial, tag, *links[i].map);
    std::vector<MapLink> agreeing{links[i]};
    for (std::size_t k = 0; k < links.size(); ++k)
      if (k != i && agrees(links[k])) agreeing.push_back(links[k]);
    if (agreeing.size() > best.size()) best = std::move(agreeing);
  }
  if (2 * best.size() <= links.size()) return false;
  links = std::move(best);
  return true;
}
}  // namespace

std::optional<Pose> WorkspaceAnchor::by_sighting(world::FilterState& state, int camera,
                                                 const Pose& X_VT, const Pose& X_WT) {
  if (is_anchored_) return std::nullopt;
  is_anchored_ = true;
  return anchor_to_known(state, camera, X_VT, X_WT, level_);
}

std::optional<Pose> WorkspaceAnchor::by_own_tags(world::FilterState& state,
                                                 std::span<const KnownTag> known) {
  if (is_anchored_) return std::nullopt;
  std::vector<MapLink> links;
  for (const KnownTag& tag : known) {
    const int own = state.find(tag.tag_id);
    if (own < 0) continue;
    links.push_back({tag.tag_id, &tag, state.tags[static_cast<std::size_t>(own)].sightings});
  }
  if (links.empty()) return std::nullopt;
  std::ranges::stable_sort(links, std::greater{}, &MapLink::sightings);
  if (!find_agreeing_links(state, level_, links)) return std::nullopt;
  is_anchored_ = true;
  return anchor_local_to_known(state, index_of(state, links.front().tag_id),
                               links.front().map->X_WT, level_);
}

std::optional<Pose> WorkspaceAnchor::by_definition(world::FilterState& state, bool may_define) {
  if (defined_by_) {
    const int tag = state.find(*defined_by_);
    if (tag >= 0) keep_defined(state, static_cast<std::size_t>(tag));
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
  heading_rule_ = make_heading_rule(gauge, state.tags[tag].X_WT.q);
  defined_by_ = state.tags[tag].tag_id;
  is_anchored_ = true;
  return anchor_to_reference(state, tag, *heading_rule_, level_);
}

void WorkspaceAnchor::keep_defined(world::FilterState& state, std::size_t tag) const {
  const world::ReferenceSlack slack = slack_of_reference(state, tag, *heading_rule_, level_);
  if (slack.moved > kSlipped || slack.sigma > kUnsure)
    anchor_to_reference(state, tag, *heading_rule_, level_);
}

/// Level pose of the tag by the floor tags; nullopt: not all of them are known.
std::optional<Pose> WorkspaceAnchor::upright_by_floor(const world::FilterState& state,
                                                      std::size_t tag) const {
  std::vector<Pose> floor;
  for (const int tag_id : gauge_.floor_tags) {
    const int own = state.find(tag_id);
    if (own < 0) return std::nullopt;
    const world::WorldTag& one = state.tags[static_cast<std::size_t>(own)];
    if (one.sightings < kSightingsOfFloor) return std::nullopt;
    floor.push_back(one.X_WT);
  }
  const auto up = up_by_floor(floor);
  if (!up) return std::nullopt;
  return Pose{upright_attitude(state.tags[tag].X_WT.q, *up), Eigen::Vector3d::Zero()};
}

}  // namespace fiducap
