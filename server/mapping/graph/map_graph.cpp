#include "mapping/graph/map_graph.hpp"

#include <algorithm>

#include "base/pose.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "mapping/graph/calibration_terms.hpp"

namespace fiducap {

namespace {

// A tag links two components when its tilt, as seen from both, differs by no more than this.
constexpr double kSameTilt_rad = 0.06;
constexpr double kSameComponent_m = 0.15;

// Position sigma below which a tag defines W: measured ones have a larger one.
constexpr double kDefined_m = 1e-5;

/// The map's covariances are against its reference tag.
bool refers_to_reference(const TagMap& map) {
  const MapTag* tag = map.reference_tag ? map.find(*map.reference_tag) : nullptr;
  return tag != nullptr && tag->component == 0 &&
         tag->tag.covariance.diagonal().head<3>().maxCoeff() < kDefined_m * kDefined_m;
}

}  // namespace

MapGraph::MapGraph(const TagMap& start) {
  std::vector<PriorTag> tags;
  bool has_survey = false;
  for (const MapTag& entry : start.tags) {
    if (!entry.is_usable()) continue;
    const KnownTag& tag = entry.tag;
    definition_[{tag.tag_id, 0}] = tag.X_WT.p;
    const bool is_surveyed = entry.state == TagState::kSurveyed;
    if (!is_surveyed && (!start.known || !start.known->is_joint(tag.tag_id))) continue;
    has_survey |= is_surveyed;
    tags.push_back({state_.tags.size(), tag.X_WT, tag.covariance, is_surveyed});
    state_.tags.push_back({.tag_id = tag.tag_id,
                           .edge_m = tag.edge_m,
                           .X_WT = tag.X_WT,
                           .component = kInWorkspace,
                           .sightings = entry.sightings,
                           .sightings_before = entry.sightings});
  }
  is_defined_ = !definition_.empty();
  if (!is_defined_) reference_tag_ = start.reference_tag;
  if (tags.empty()) return;
  state_.level[kInWorkspace] = true;
  const auto between = [&](std::size_t a, std::size_t b) {
    return start.known ? start.known->between(state_.tags[a].tag_id, state_.tags[b].tag_id)
                       : std::nullopt;
  };
  const bool is_absolute = has_survey || refers_to_reference(start);
  state_.prior = make_prior(tags, between, {},
                            is_absolute ? PriorUnknown::kNothing : PriorUnknown::kPlaceAndYaw);
}

bool MapGraph::establish_workspace() {
  std::map<int, int> tags;
  for (const GraphTag& tag : state_.tags) ++tags[tag.component];
  if (tags.empty() || tags.contains(kInWorkspace)) return false;
  const auto largest = std::ranges::max_element(
      tags, [](const auto& a, const auto& b) { return a.second < b.second; });
  merge_components(largest->first, kInWorkspace, Pose{}, state_);
  return true;
}

/// Index of the body since the last jump of its clocks.
std::size_t MapGraph::body_of(const MotionSegment& segment) {
  auto& bodies = state_.bodies;
  const auto found = std::find_if(bodies.rbegin(), bodies.rend(), [&](const GraphBody& body) {
    return body.id == segment.body_id;
  });
  if (found == bodies.rend()) {
    bodies.push_back(body_by_configuration(segment.body_id, segment.sensors));
    if (segment.has_imu())
      state_.gravity_sigma_m_s2 =
          std::min(state_.gravity_sigma_m_s2, segment.sensors->gravity_sigma_m_s2);
    return bodies.size() - 1;
  }
  const std::size_t index = bodies.size() - 1 - static_cast<std::size_t>(found - bodies.rbegin());
  if (continues_chain(segment) || !clock_has_jumped(bodies[index], segment)) return index;
  bodies.push_back(after_clock_jump(bodies[index], static_cast<int>(index), segment));
  return bodies.size() - 1;
}

bool MapGraph::add(MotionSegment segment) {
  const std::size_t body = body_of(segment);
  const std::vector<int> epochs = epochs_.sort(segment);
  if (segment.tags.empty() && !continues_chain(segment)) return false;
  GraphSegment entry;
  auto factor = condense(segment);
  if (!factor) return false;
  entry.factor = std::move(*factor);
  entry.begin = continues_chain(segment)
                    ? *chains_.at(segment.body_id).node
                    : begin_chain(body, segment, is_in_workspace(segment, epochs));
  const GraphNode& begin = state_.nodes[entry.begin];
  // A body that began in axes of its own may have been anchored since.
  if (begin.component != kInWorkspace && is_in_workspace(segment, epochs))
    merge_components(
        begin.component, kInWorkspace,
        axes_between(begin.at.X_WB, segment.begin().X_WB, state_.level.at(begin.component)),
        state_);
  const int component = state_.nodes[entry.begin].component;
  const Pose G =
      axes_between(segment.begin().X_WB, state_.nodes[entry.begin].at.X_WB, segment.has_imu());
  entry.end = state_.nodes.size();
  state_.nodes.push_back({static_cast<int>(body), in_other_axes(G, segment.end()), component});
  state_.nodes.back().at.at = segment.end().at;
  entry.raw = std::move(segment);
  bind_tags(G, epochs, entry);
  follow_filter(entry.raw, first_of(body, state_), state_);
  hold_reference(entry, epochs);
  count_sightings(entry);
  chains_[entry.raw.body_id] = {entry.end, entry.raw.chain};
  state_.segments.push_back(std::move(entry));
  link_components(state_.segments.back(), component);
  return true;
}

/// False when a segment between is missing: the motion there is unknown.
bool MapGraph::continues_chain(const MotionSegment& segment) const {
  const auto chain = chains_.find(segment.body_id);
  return chain != chains_.end() && chain->second.node && chain->second.number == segment.chain &&
         state_.nodes[*chain->second.node].at.at == segment.begin().at;
}

/// @param G  from the filter's axes, which the segment's tags are in, to the component's
void MapGraph::bind_tags(const Pose& G, const std::vector<int>& epochs, GraphSegment& entry) {
  entry.tags.clear();
  const int component = component_of(entry);
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    const KnownTag& tag = entry.raw.tags[i];
    const auto found = std::ranges::find_if(state_.tags, [&](const GraphTag& t) {
      return t.tag_id == tag.tag_id && t.component == component && t.epoch == epochs[i];
    });
    entry.tags.push_back(static_cast<std::size_t>(found - state_.tags.begin()));
    if (found != state_.tags.end()) continue;
    GraphTag added{.tag_id = tag.tag_id,
                   .edge_m = tag.edge_m,
                   .X_WT = G * tag.X_WT,
                   .component = component,
                   .first_seen = entry.raw.begin().at,
                   .epoch = epochs[i]};
    // The same printed tag as in other components, or as before it was moved.
    const auto same = std::find_if(state_.tags.rbegin(), state_.tags.rend(),
                                   [&](const GraphTag& t) { return t.tag_id == tag.tag_id; });
    if (same != state_.tags.rend()) {
      added.scale = same->scale;
      added.scale_is_open = same->scale_is_open;
    }
    state_.tags.push_back(added);
  }
}

std::size_t MapGraph::begin_chain(std::size_t body, const MotionSegment& segment,
                                  bool is_in_workspace) {
  const int component = is_in_workspace ? kInWorkspace : ++components_;
  state_.level[component] =
      state_.level[component] || segment.has_imu() || segment.up_B.has_value();
  const auto last = chains_.find(segment.body_id);
  ChainStart start{.node = state_.nodes.size(), .has_imu = segment.has_imu()};
  start.up_B = segment.up_B;
  if (last != chains_.end() && last->second.node && segment.has_imu()) {
    start.after = static_cast<int>(*last->second.node);
    const InertialInput& input = segment.instances[1].steps.front().input;
    start.accel_walk = std::max(1e-6, input.accel_walk);
    start.gyro_walk = std::max(1e-7, input.gyro_walk);
  }
  if (last == chains_.end()) initialise_cameras(segment.cameras, state_.bodies[body]);
  state_.nodes.push_back({static_cast<int>(body), segment.begin(), component});
  state_.starts.push_back(start);
  return start.node;
}

/// The body's filter is anchored, and a tag of the segment is in the workspace: every part of a
/// component must be connected to the rest by a sighting.
bool MapGraph::is_in_workspace(const MotionSegment& segment, const std::vector<int>& epochs) const {
  if (!segment.anchored) return false;
  const auto is_there = [](const auto& x) { return x.component == kInWorkspace; };
  if (std::ranges::none_of(state_.nodes, is_there) && std::ranges::none_of(state_.tags, is_there))
    return true;
  return std::ranges::any_of(state_.tags, [&](const GraphTag& tag) {
    for (std::size_t i = 0; i < epochs.size() && is_there(tag); ++i)
      if (segment.tags[i].tag_id == tag.tag_id && epochs[i] == tag.epoch) return true;
    return false;
  });
}

void MapGraph::count_sightings(const GraphSegment& entry) {
  std::map<int, std::size_t> numbers;
  for (const std::size_t i : entry.tags) numbers[state_.tags[i].tag_id] = i;
  for (const MotionSegment::Instance& instance : entry.raw.instances) {
    for (const SegmentImage& image : instance.images) {
      for (const SegmentSighting& sighting : image.tags) {
        GraphTag& tag = state_.tags[numbers.at(sighting.seen.tag_id)];
        ++tag.sightings;
        tag.last_seen = instance.body.at;
      }
    }
  }
}

/// Common tags give the transformation to another component; when they agree, the two are merged.
void MapGraph::link_components(const GraphSegment& entry, int component) {
  const Pose G =
      axes_between(entry.factor.begin.X_WB, state_.nodes[entry.begin].at.X_WB, entry.raw.has_imu());
  std::map<int, std::vector<Pose>> links;  // T: from this component to the other
  for (std::size_t i = 0; i < entry.tags.size(); ++i) {
    const Pose here = G * entry.factor.tags[i].X_WT;
    for (const GraphTag& tag : state_.tags) {
      if (tag.tag_id != entry.factor.tags[i].tag_id || tag.component == component ||
          tag.epoch != state_.tags[entry.tags[i]].epoch)
        continue;
      const bool level = state_.level.at(component) && state_.level.at(tag.component);
      const Pose T = axes_between(here, tag.X_WT, level);
      if (angle_between((T * here).q, tag.X_WT.q) < kSameTilt_rad)
        links[tag.component].push_back(T);
    }
  }
  const Eigen::Vector3d body = state_.nodes[entry.begin].at.X_WB.p;
  for (const auto& [other, all] : links) {
    const Eigen::Vector3d there = all.front() * body;
    const bool agree = std::ranges::all_of(
        all, [&](const Pose& T) { return (T * body - there).norm() < kSameComponent_m; });
    if (!agree) continue;
    // The workspace keeps its axes.
    if (component != kInWorkspace) {
      merge_components(component, other, all.front(), state_);
    } else {
      merge_components(other, component, all.front().inverse(), state_);
    }
    return;
  }
}

/// The reference tag of the body that is anchored by it is fixed by definition.
void MapGraph::hold_reference(const GraphSegment& entry, const std::vector<int>& epochs) {
  if (!reference_tag_ || component_of(entry) != kInWorkspace || !entry.raw.anchored) return;
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    if (entry.raw.tags[i].tag_id != *reference_tag_ || epochs[i] != 0) continue;
    state_.prior.hold(entry.tags[i], entry.raw.tags[i].X_WT, state_.level.at(kInWorkspace));
    reference_tag_.reset();
    return;
  }
}

}  // namespace fiducap
