#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "pipeline/replay/image_log.hpp"
#include "pipeline/replay/image_placement.hpp"

namespace fiducap {

/// @return whether one is elsewhere than before
bool ImagePlacement::place_instants(bool all) {
  bool changed = false;
  for (std::size_t b = 0; b < placed_.size(); ++b) {
    for (std::size_t i = 0; i < placed_[b].size(); ++i) {
      if (!all && !waits_[b][i]) continue;
      waits_[b][i] = false;
      changed |= place_instant(b, i);
    }
  }
  return changed;
}

/// Places instants beside a placed one by odometry, and their tags by them, in order of time: a tag
/// is placed by its first visit, and later visits by the tag.
/// @return whether anything was placed
bool ImagePlacement::follow_odometry(std::size_t body) {
  if (bodies_[body].odometry == nullptr) return false;
  const auto count = placed_[body].size();
  bool changed = false;
  for (std::size_t i = 1; i < count; ++i) changed |= carry(body, i - 1, i);
  for (std::size_t i = count; i-- > 1;) changed |= carry(body, i, i - 1);
  return changed;
}

/// @return whether `to` was placed
bool ImagePlacement::carry(std::size_t body, std::size_t from, std::size_t to) {
  const Placed& before = placed_[body][from];
  Placed& now = placed_[body][to];
  if (now.region != kNowhere || before.region == kNowhere) return false;
  const auto moved = bodies_[body].odometry->motion(before.at, now.at);
  if (!moved) return false;
  now.region = before.region;
  now.X_WB = before.X_WB * *moved;
  now.is_sure = true;
  place_instant(body, to);
  for (const TagObservations& image : seen_[body][to])
    for (const TagObservation& seen : image.tags)
      if (!tags_.contains(seen.tag_id)) place_tag(seen.tag_id);
  return true;
}

bool ImagePlacement::grow() {
  constexpr int kMostTurns = 100;
  bool changed = false;
  for (int turn = 0; turn < kMostTurns; ++turn) {
    const bool moved = place_instants(false);
    bool is_new = false;
    for (std::size_t b = 0; b < bodies_.size(); ++b) is_new |= follow_odometry(b);
    for (const auto& [tag_id, seen] : sightings_)
      if (!tags_.contains(tag_id)) is_new |= place_tag(tag_id);
    changed |= moved || is_new;
    if (!is_new) break;
  }
  return changed;
}

bool ImagePlacement::settle() {
  bool changed = place_instants(true);
  for (const auto& [tag_id, tag] : std::map(tags_)) changed |= place_tag(tag_id);
  do changed |= grow();
  while (begin_elsewhere() || begin_with_two() || begin_with_one() || join_regions());
  return changed;
}

namespace {

// Images with both tags, for their relative pose.
constexpr std::size_t kLeastTogether = 5;
constexpr std::size_t kMostTogether = 30;
constexpr std::size_t kProposing = 8;
// A pose is accepted when all others explain the images this much worse, as for single tags.
constexpr double kEvidence = 20.0;

/// The best one; nullopt: another one is nearly as good, or it explains less than half.
std::optional<Pose> only_way(const std::vector<CostedPose>& ways, double fitting_cost) {
  if (ways.empty()) return std::nullopt;
  const CostedPose& best = *std::ranges::min_element(
      ways, [](const CostedPose& a, const CostedPose& b) { return a.cost < b.cost; });
  const bool is_alone = std::ranges::all_of(ways, [&](const CostedPose& way) {
    return way.cost > best.cost + kEvidence ||
           angle_between(way.X.q, best.X.q) < filter_rules::kOtherBranch_rad;
  });
  return is_alone && best.cost < fitting_cost ? std::optional(best.X) : std::nullopt;
}

}  // namespace

/// Possible poses of a body by tags, with their costs.
std::vector<CostedPose> ImagePlacement::ways_at(const View& view,
                                                const std::vector<SightedTag>& tags) const {
  const double noise_px = bodies_[view.body].corner_noise_px;
  std::vector<CostedPose> ways;
  for (const SightedTag& tag : tags)
    for (const TagPose& pose : solve_tag_pose(*tag.seen, *tag.camera)) {
      if (!std::isfinite(pose.rms_px)) continue;
      const Pose X_AB = improved(tag.X_AT * (tag.X_BV * pose.X_VT).inverse(), tags, noise_px);
      ways.push_back({X_AB, misfit(tags, X_AB, noise_px)});
    }
  return ways;
}

CostedPose ImagePlacement::best_at(const View& view, const std::vector<SightedTag>& tags) const {
  CostedPose best{{}, std::numeric_limits<double>::max()};
  for (const CostedPose& way : ways_at(view, tags))
    if (way.cost < best.cost) best = way;
  return best;
}

std::vector<SightedTag> ImagePlacement::sighted_of(const View& view, int tag_id,
                                                   const Pose& X_AT) const {
  std::vector<SightedTag> out;
  for (const TagObservations& image : seen_[view.body][view.instant]) {
    const CameraMount& camera = cameras_[view.body][static_cast<std::size_t>(image.camera)];
    for (const TagObservation& seen : image.tags)
      if (seen.tag_id == tag_id) out.push_back({&seen, &camera.model, camera.X_BV, X_AT});
  }
  return out;
}

/// Pose of the second tag relative to the first, by images of both.
std::optional<Pose> ImagePlacement::between(int first, int second,
                                            const std::vector<View>& views) const {
  const auto with = [&](const View& view, const Pose& X_ab) {
    std::vector<SightedTag> tags = sighted_of(view, first, {});
    for (const SightedTag& tag : sighted_of(view, second, X_ab)) tags.push_back(tag);
    return tags;
  };
  std::vector<CostedPose> ways;
  for (std::size_t i = 0; i < std::min(kProposing, views.size()); ++i) {
    const View& view = views[i * views.size() / std::min(kProposing, views.size())];
    for (const SightedTag& a : sighted_of(view, first, {}))
      for (const SightedTag& b : sighted_of(view, second, {}))
        for (const TagPose& of_a : solve_tag_pose(*a.seen, *a.camera))
          for (const TagPose& of_b : solve_tag_pose(*b.seen, *b.camera))
            if (std::isfinite(of_a.rms_px + of_b.rms_px))
              ways.push_back({(a.X_BV * of_a.X_VT).inverse() * (b.X_BV * of_b.X_VT), 0.0});
  }
  constexpr int kRounds = 5;
  for (CostedPose& way : ways) {
    for (int round = 0; round < kRounds; ++round) {
      // Relative to the second tag, all cameras are one rigid body.
      std::vector<SightedTag> from_second;
      double noise_px = 0;
      way.cost = 0;
      for (const View& view : views) {
        const CostedPose body = best_at(view, with(view, way.X));
        way.cost += body.cost;
        noise_px = std::max(noise_px, bodies_[view.body].corner_noise_px);
        for (const SightedTag& tag : sighted_of(view, second, {}))
          from_second.push_back({tag.seen, tag.camera, body.X * tag.X_BV, {}});
      }
      if (round + 1 < kRounds) way.X = improved(way.X.inverse(), from_second, noise_px).inverse();
    }
  }
  const auto sightings = static_cast<double>(2 * views.size());
  return only_way(ways, sightings * kSightingBend * std::log(2.0));
}

/// Two unplaced tags that are often seen together begin a region, with the axes of the first.
bool ImagePlacement::begin_with_two() {
  std::map<std::pair<int, int>, std::vector<View>> together;
  for (std::size_t b = 0; b < seen_.size(); ++b) {
    for (std::size_t i = 0; i < seen_[b].size(); ++i) {
      std::set<int> ids;
      for (const TagObservations& image : seen_[b][i])
        for (const TagObservation& seen : image.tags)
          if (!tags_.contains(seen.tag_id)) ids.insert(seen.tag_id);
      for (auto first = ids.begin(); first != ids.end(); ++first)
        for (auto second = std::next(first); second != ids.end(); ++second)
          together[{*first, *second}].push_back({b, i});
    }
  }
  for (const auto& [pair, views] : together) {
    if (views.size() < kLeastTogether || were_tried_.contains({pair, views.size()})) continue;
    were_tried_.insert({pair, views.size()});
    const auto [first, second] = pair;
    const auto X_ab = between(first, second, thinned(views, kMostTogether));
    if (!X_ab) continue;
    const int region = tags_.empty() ? 0 : regions_++;
    put({first, sightings_[first].front().seen->edge_m, {}, Matrix6d::Zero()}, region, false);
    put({second, sightings_[second].front().seen->edge_m, *X_ab, Matrix6d::Zero()}, region, false);
    return true;
  }
  return false;
}

/// A single tag that is near enough in some images for an unambiguous pose begins a region.
bool ImagePlacement::begin_with_one() {
  for (const auto& [tag_id, sightings] : sightings_) {
    if (tags_.contains(tag_id)) continue;
    std::size_t sure = 0;
    for (const Sighting& s : sightings) {
      if (placed_[s.body][s.instant].region != kNowhere) continue;
      const auto tags = sighted_of({s.body, s.instant}, tag_id, {});
      if (only_way(ways_at({s.body, s.instant}, tags), std::numeric_limits<double>::max())) ++sure;
    }
    if (sure < kLeastTogether) continue;
    put({tag_id, sightings.front().seen->edge_m, {}, Matrix6d::Zero()},
        tags_.empty() ? 0 : regions_++, false);
    return true;
  }
  return false;
}

/// A region that images connect with the workspace by now becomes part of it.
bool ImagePlacement::join_regions() {
  for (int region = 1; region < regions_; ++region) {
    std::vector<View> views;
    for (std::size_t b = 0; b < seen_.size(); ++b)
      for (std::size_t i = 0; i < seen_[b].size(); ++i)
        if (!sighted(b, i, 0).empty() && !sighted(b, i, region).empty()) views.push_back({b, i});
    const auto X_0r = views.empty() ? std::nullopt : over(region, thinned(views, kMostTogether));
    if (!X_0r) continue;
    for (const auto& [tag_id, tag] : std::map(tags_))
      if (tag.region == region)
        put({tag_id, tag.tag.edge_m, *X_0r * tag.tag.X_WT, Matrix6d::Zero()}, 0, false);
    for (std::vector<Placed>& body : placed_)
      for (Placed& placed : body)
        if (placed.region == region) placed = {placed.at, 0, *X_0r * placed.X_WB, placed.is_sure};
    return true;
  }
  return false;
}

/// Pose of a region in the workspace, by images of tags of both.
std::optional<Pose> ImagePlacement::over(int region, const std::vector<View>& views) const {
  std::vector<CostedPose> ways;
  for (std::size_t i = 0; i < std::min(kProposing, views.size()); ++i) {
    const View& view = views[i * views.size() / std::min(kProposing, views.size())];
    for (const PlaceProposal& there : proposals(view.body, view.instant, region))
      for (const PlaceProposal& here : proposals(view.body, view.instant, 0))
        ways.push_back({tags_.at(here.tag_id).tag.X_WT * here.X_TB *
                            (tags_.at(there.tag_id).tag.X_WT * there.X_TB).inverse(),
                        0.0});
  }
  std::size_t sightings = 0;
  for (const View& view : views) {
    const std::vector<SightedTag> here = sighted(view.body, view.instant, 0);
    const std::vector<SightedTag> there = sighted(view.body, view.instant, region);
    sightings += here.size() + there.size();
    for (CostedPose& way : ways) {
      std::vector<SightedTag> all = here;
      for (SightedTag tag : there) {
        tag.X_AT = way.X * tag.X_AT;
        all.push_back(tag);
      }
      way.cost += best_at(view, all).cost;
    }
  }
  return only_way(ways, static_cast<double>(sightings) * kSightingBend * std::log(2.0));
}

/// Nothing is known: W has the axes of the first body's odometry.
bool ImagePlacement::begin_by_odometry() {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const Odometry* const odometry = bodies_[b].odometry;
    if (odometry == nullptr) continue;
    const auto first = std::find_if(placed_[b].begin(), placed_[b].end(), [&](const Placed& one) {
      return one.region == kNowhere && odometry->covers(one.at);
    });
    if (first == placed_[b].end()) continue;
    first->region = 0;
    first->X_WB = odometry->pose_at(first->at);
    first->is_sure = true;
    is_by_odometry_ = true;
    return true;
  }
  return false;
}

void ImagePlacement::define_workspace(const WorkspaceGauge& gauge) {
  if (!is_by_odometry_) return;
  const auto tag = gauge.reference_tag ? tags_.find(*gauge.reference_tag) : tags_.begin();
  if (tag == tags_.end() || tag->second.region != 0) return;
  const Pose& X_WT = tag->second.tag.X_WT;
  const HeadingRule rule = make_heading_rule(gauge, X_WT.q);
  // Odometry knows the vertical.
  const Eigen::Quaterniond turn = turn_to_heading(rule, X_WT.q);
  const Pose X_new_old{turn, rule.X_WT.p - turn * X_WT.p};
  for (auto& [tag_id, one] : tags_)
    if (one.region == 0) one.tag.X_WT = X_new_old * one.tag.X_WT;
  for (std::vector<Placed>& body : placed_)
    for (Placed& placed : body)
      if (placed.region == 0) placed.X_WB = X_new_old * placed.X_WB;
  is_by_odometry_ = false;
}

/// Begins with a surveyed tag, or with odometry if there is nothing else, or with a map in other
/// axes.
bool ImagePlacement::begin_elsewhere() {
  const KnownTag* best = nullptr;
  for (const auto& [tag_id, tag] : surveyed_) {
    if (tags_.contains(tag_id) || !sightings_.contains(tag_id)) continue;
    if (best == nullptr || sightings_[tag_id].size() > sightings_[best->tag_id].size()) best = &tag;
  }
  if (best != nullptr) {
    put(*best, 0, false);
    return true;
  }
  if (tags_.empty() && begin_by_odometry()) return true;
  while (!suggested_.empty()) {
    auto most = std::ranges::max_element(
        suggested_, [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
    const auto tags = std::move(most->second);
    suggested_.erase(most);
    // The largest is the workspace, if there is none yet.
    const int region = tags_.empty() ? 0 : regions_;
    bool is_new = false;
    for (const auto& [tag_id, tag] : tags) {
      if (tags_.contains(tag_id)) continue;
      put(tag, region, false);
      is_new = true;
    }
    if (!is_new) continue;
    if (region > 0) ++regions_;
    return true;
  }
  return false;
}

}  // namespace fiducap
