#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "estimation/conversation/map_links.hpp"
#include "estimation/filter/floor.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap {

/// Where the workspace W is, for one filter. Defined once: by a tag of the map, by a surveyed tag,
/// or, when the map has none, by the reference tag or the first one. From then on the tag that
/// defined it is one like any other, and only the map moves.
///
/// What defines W answers X_new_old: every pose given out before is X_new = X_new_old X_old.
template <class Coordinates>
class WorkspaceAnchor final {
 public:
  /// @param level  gravity says what is up
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
  /// No tag of the state defines it any more.
  void give_to_map() { defined_by_.reset(); }
  [[nodiscard]] bool is_anchored() const { return is_anchored_; }
  /// The tag of the state that W is defined by; nullopt: by the map, or it is gone.
  [[nodiscard]] std::optional<int> defined_by() const { return defined_by_; }

  /// By a tag with a place in W, seen at X_VT; where W is, is unknown until the update that
  /// follows.
  std::optional<Pose> by_sighting(Coordinates& coordinates, int camera, const Pose& X_VT,
                                  const Pose& X_WT) {
    if (is_anchored_) return std::nullopt;
    is_anchored_ = true;
    return anchor_to_known(coordinates.state(), camera, X_VT, X_WT, level_);
  }

  /// By tags of the state that the map has learned of: a body that knew them before the map did.
  /// @param gives_tags  to the map, each on its own
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
    std::stable_sort(links.begin(), links.end(),
                     [](const auto& a, const auto& b) { return a.sightings > b.sightings; });
    if (!find_agreeing_links(state, level_, links)) return std::nullopt;
    const auto index = [&](const MapLink& link) {
      return static_cast<std::size_t>(state.find(link.tag_id));
    };
    is_anchored_ = true;
    const Pose shift =
        anchor_local_to_known(state, index(links.front()), links.front().map->X_WT, level_);
    if (gives_tags) {
      for (const MapLink& link : links) coordinates.give_to_map(index(link), *link.map);
    }
    return shift;
  }

  /// By a tag of its own, when it may. Afterwards: takes back what linearisation let slip.
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
  // What is up stays as it was defined: not by a tag that was hardly seen.
  static constexpr int kSightingsOfFloor = 20;

  /// Where the tag stands when the floor tags lie flat; nullopt: not all of them are known.
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
