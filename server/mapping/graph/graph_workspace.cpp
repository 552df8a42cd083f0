// Where the workspace of a map graph is, at the beginning and later.
#include <algorithm>

#include "estimation/filter/heading_rule.hpp"
#include "mapping/graph/graph_components.hpp"
#include "mapping/graph/graph_datum.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap {

namespace {

// Whose place is known like this is where W hangs: anything that was measured is known worse.
constexpr double kDefined_m = 1e-5;

/// Its reference tag is where W hangs: what the map says of its tags is against that.
bool hangs_on_reference(const TagMap& map) {
  const MapTag* tag = map.reference_tag ? map.find(*map.reference_tag) : nullptr;
  return tag != nullptr && tag->component == 0 &&
         tag->tag.covariance.diagonal().head<3>().maxCoeff() < kDefined_m * kDefined_m;
}

}  // namespace

MapGraph::MapGraph(const TagMap& start) {
  std::vector<PriorTag> tags;
  bool has_survey = false;
  for (const MapTag& entry : start.tags) {
    if (entry.component != 0 || entry.state == TagState::kQuarantined) continue;
    const KnownTag& tag = entry.tag;
    definition_[{tag.tag_id, 0}] = tag.X_WT.p;
    const bool is_surveyed = entry.state == TagState::kSurveyed;
    if (!is_surveyed && (!start.known || start.known->find(tag.tag_id) == nullptr)) continue;
    has_survey |= is_surveyed;
    tags.push_back({state_.tags.size(), tag.X_WT, tag.covariance, is_surveyed});
    state_.tags.push_back({.tag_id = tag.tag_id,
                           .edge_m = tag.edge_m,
                           .X_WT = tag.X_WT,
                           .component = kInWorkspace,
                           .sightings = entry.sightings,
                           .sightings_before = entry.sightings,
                           .print = {}});
  }
  is_defined_ = !definition_.empty();
  if (!is_defined_) reference_tag_ = start.reference_tag;
  if (tags.empty()) return;
  state_.level[kInWorkspace] = true;
  const auto between = [&](std::size_t a, std::size_t b) {
    return start.known ? start.known->between(state_.tags[a].tag_id, state_.tags[b].tag_id)
                       : std::nullopt;
  };
  const bool is_absolute = has_survey || hangs_on_reference(start);
  state_.prior = make_prior(tags, between, {},
                            is_absolute ? PriorUnknown::kNothing : PriorUnknown::kPlaceAndYaw);
}

bool MapGraph::found_workspace() {
  std::map<int, int> tags;
  for (const GraphTag& tag : state_.tags) ++tags[tag.component];
  if (tags.empty() || tags.contains(kInWorkspace)) return false;
  const auto largest = std::max_element(
      tags.begin(), tags.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  merge_components(largest->first, kInWorkspace, Pose{}, state_);
  return true;
}

/// A body that stands in the workspace by its reference tag: the tag is where it is by definition.
void MapGraph::hold_reference(const MotionSegment& segment, const std::vector<int>& epochs,
                              int component) {
  if (!reference_tag_ || component != kInWorkspace || !segment.anchored) return;
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    if (segment.tags[i].tag_id != *reference_tag_ || epochs[i] != 0) continue;
    const auto tag = std::find_if(state_.tags.begin(), state_.tags.end(), [&](const GraphTag& t) {
      return t.tag_id == *reference_tag_ && t.component == kInWorkspace && t.epoch == 0;
    });
    state_.prior.hold(static_cast<std::size_t>(tag - state_.tags.begin()), segment.tags[i].X_WT,
                      state_.level.at(kInWorkspace));
    reference_tag_.reset();
    return;
  }
}

void MapGraph::lay_over_definition() {
  if (state_.prior.is_absolute) return;
  if (!is_defined_) {
    // Until somebody says where W is, it stays where it was.
    if (!definition_.empty()) lay_over_places();
    definition_.clear();
    for (const GraphTag& tag : state_.tags)
      if (tag.component == kInWorkspace) definition_[{tag.tag_id, tag.epoch}] = tag.X_WT.p;
    return;
  }
  lay_over_places();
}

void MapGraph::lay_over_places() {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const GraphTag& tag : state_.tags) {
    const auto was = definition_.find({tag.tag_id, tag.epoch});
    if (was != definition_.end() && tag.component == kInWorkspace)
      points.emplace_back(tag.X_WT.p, was->second);
  }
  if (points.size() > 1) move_component(kInWorkspace, lay_over(points), state_);
}

}  // namespace fiducap
