#include "pipeline/replay/image_placement.hpp"

#include <algorithm>
#include <cmath>

#include "base/numeric.hpp"
#include "detection/observe.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/filter/filter_rules.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kProposingTags = 4;  // the largest ones
// Evidence that decides a tag's branch, as in the filter (EstimatorConfig), and that revises it.
constexpr double kBranchEvidence = 20.0;
constexpr std::size_t kProposingSightings = 8;
constexpr std::size_t kJudgingSightings = 100;
constexpr double kLeastFitting = 0.5;  // of its sightings
// From one viewpoint, corners repeat themselves and show little noise.
constexpr double kLeastNoise_px = 0.05;

}  // namespace

ImagePlacement::ImagePlacement(std::vector<BodyToPlace> bodies) : bodies_(std::move(bodies)) {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const auto& instants = bodies_[b].log->instants();
    seen_.emplace_back(instants.size());
    placed_.emplace_back();
    for (const LoggedInstant& instant : instants)
      placed_.back().push_back({.at = instant.at, .X_WB = {}});
    waits_.emplace_back(instants.size(), true);
    cameras_.emplace_back();
    look_through(b);
    for (std::size_t i = 0; i < instants.size(); ++i)
      for (std::size_t k = 0; k < seen_[b][i].size(); ++k)
        for (const TagObservation& tag : seen_[b][i][k].tags)
          sightings_[tag.tag_id].push_back({b, i, k, &tag});
  }
}

/// Undistorts the corners by the present lenses.
void ImagePlacement::look_through(std::size_t body) {
  cameras_[body] = bodies_[body].cameras;
  for (std::size_t c = 0; c < cameras_[body].size(); ++c) {
    cameras_[body][c].X_BV = bodies_[body].beliefs[c].X_BV;
    cameras_[body][c].model = bodies_[body].beliefs[c].lens.applied_to(cameras_[body][c].model);
  }
  const auto& instants = bodies_[body].log->instants();
  for (std::size_t i = 0; i < instants.size(); ++i) {
    const bool is_new = seen_[body][i].empty();
    if (is_new) seen_[body][i] = instants[i].images;
    for (std::size_t k = 0; k < seen_[body][i].size(); ++k) {
      TagObservations& image = seen_[body][i][k];
      const auto camera = static_cast<std::size_t>(image.camera);
      if (is_new && bodies_[body].beliefs[camera].lens.is_none()) continue;
      for (TagObservation& tag : image.tags) {
        TagObservation other = tag;
        if (undistort_tag(cameras_[body][camera].model, other)) tag = other;
      }
    }
  }
}

/// By placed tags; the filter's come first.
std::vector<PlaceProposal> ImagePlacement::proposals(std::size_t body, std::size_t instant,
                                                     int region) const {
  std::vector<std::pair<const TagObservation*, const CameraMount*>> seen;
  for (const TagObservations& image : seen_[body][instant])
    for (const TagObservation& tag : image.tags)
      if (is_in(tag.tag_id, region))
        seen.emplace_back(&tag, &cameras_[body][static_cast<std::size_t>(image.camera)]);
  std::ranges::stable_sort(
      seen, [](const auto& a, const auto& b) { return size_px(*a.first) > size_px(*b.first); });
  if (seen.size() > kProposingTags) seen.resize(kProposingTags);
  std::vector<PlaceProposal> all;
  for (const PlaceProposal& one : bodies_[body].log->instants()[instant].proposals)
    if (is_in(one.tag_id, region)) all.push_back(one);
  for (const auto& [tag, camera] : seen)
    for (const TagPose& pose : solve_tag_pose(*tag, camera->model))
      if (std::isfinite(pose.rms_px))
        all.push_back({tag->tag_id, (camera->X_BV * pose.X_VT).inverse()});
  return all;
}

bool ImagePlacement::is_in(int tag_id, int region) const {
  const auto tag = tags_.find(tag_id);
  return tag != tags_.end() && tag->second.region == region;
}

void ImagePlacement::put(const KnownTag& tag, int region, bool is_held) {
  tags_[tag.tag_id] = {tag, region, is_held};
  for (const Sighting& s : sightings_[tag.tag_id]) waits_[s.body][s.instant] = true;
}

void ImagePlacement::hold(const KnownTag& tag) { put(tag, 0, true); }

void ImagePlacement::suggest(int component, const KnownTag& tag) {
  const auto known = tags_.find(tag.tag_id);
  if (known != tags_.end() && known->second.is_held) return;
  if (component == 0) return put(tag, 0, false);
  suggested_[component].emplace(tag.tag_id, tag);
}

void ImagePlacement::take(std::size_t body, const std::vector<CameraBelief>& cameras,
                          std::span<const StampedPose> poses) {
  bodies_[body].beliefs = cameras;
  look_through(body);
  auto pose = poses.begin();
  for (Placed& placed : placed_[body]) {
    while (pose != poses.end() && pose->at < placed.at) ++pose;
    if (pose != poses.end() && pose->at == placed.at && placed.region == 0)
      placed.X_WB = pose->X_WB;
  }
}

void ImagePlacement::take(const KnownTag& tag) {
  const auto known = tags_.find(tag.tag_id);
  if (known != tags_.end() && known->second.region == 0 && !known->second.is_held)
    known->second.tag.X_WT = tag.X_WT;
}

double ImagePlacement::learn_noise(std::size_t body) {
  constexpr double kMedian = 7.344;  // of chi-square with 8 degrees of freedom
  std::vector<double> squares;
  for (std::size_t i = 0; i < placed_[body].size(); ++i) {
    const Placed& placed = placed_[body][i];
    for (const SightedTag& tag : sighted(body, i, placed.region)) {
      const Pose X_VT = (placed.X_WB * tag.X_BV).inverse() * tag.X_AT;
      const CornerResidual r = corner_residual(*tag.seen, X_VT, *tag.camera);
      if (r.in_front) squares.push_back(r.y.squaredNorm());
    }
  }
  double& noise_px = bodies_[body].corner_noise_px;
  if (!squares.empty())
    noise_px = std::max(kLeastNoise_px, std::sqrt(quantile(std::move(squares), 0.5) / kMedian));
  return noise_px;
}

/// The lowest region of the instant's tags.
int ImagePlacement::region_of(std::size_t body, std::size_t instant) const {
  int region = kNowhere;
  for (const TagObservations& image : seen_[body][instant]) {
    for (const TagObservation& seen : image.tags) {
      const auto tag = tags_.find(seen.tag_id);
      if (tag == tags_.end()) continue;
      if (region == kNowhere || tag->second.region < region) region = tag->second.region;
    }
  }
  return region;
}

std::vector<SightedTag> ImagePlacement::sighted(std::size_t body, std::size_t instant,
                                                int region) const {
  std::vector<SightedTag> out;
  for (const TagObservations& image : seen_[body][instant]) {
    const CameraMount& camera = cameras_[body][static_cast<std::size_t>(image.camera)];
    for (const TagObservation& seen : image.tags) {
      if (is_in(seen.tag_id, region))
        out.push_back({&seen, &camera.model, camera.X_BV, tags_.at(seen.tag_id).tag.X_WT});
    }
  }
  return out;
}

/// Distinguishes poses that explain an instant equally well by the instants before and after.
double ImagePlacement::jump(std::size_t body, std::size_t instant, const Pose& X_WB) const {
  const auto& placed = placed_[body];
  const Placed& own = placed[instant];
  double cost = 0;
  const auto add = [&](const Placed& other) {
    if (other.region == own.region)
      cost += motion_misfit({other.at, other.X_WB}, {own.at, X_WB}, bodies_[body].odometry);
  };
  if (instant > 0) add(placed[instant - 1]);
  if (instant + 1 < placed.size()) add(placed[instant + 1]);
  return cost;
}

/// @return whether it is elsewhere than before
bool ImagePlacement::place_instant(std::size_t body, std::size_t instant) {
  Placed& placed = placed_[body][instant];
  const int region = region_of(body, instant);
  if (region == kNowhere) return false;
  const bool was_there = placed.region == region;
  placed.region = region;
  const double noise_px = bodies_[body].corner_noise_px;
  const std::vector<SightedTag> tags = sighted(body, instant, region);
  std::vector<Choice> choices;
  const auto offer = [&](const Pose& X_WB) {
    choices.push_back({X_WB, misfit(tags, X_WB, noise_px) + jump(body, instant, X_WB), false});
  };
  if (was_there) offer(improved(placed.X_WB, tags, noise_px));
  for (const PlaceProposal& one : proposals(body, instant, region))
    offer(improved(tags_.at(one.tag_id).tag.X_WT * one.X_TB, tags, noise_px));
  const auto best = std::ranges::min_element(
      choices, [](const auto& a, const auto& b) { return a.cost < b.cost; });
  const bool stays =
      was_there && choices.front().cost - filter_rules::kEvidenceToFollow < best->cost;
  const Choice& chosen = stays ? choices.front() : *best;
  placed.is_sure = std::ranges::all_of(choices, [&](const Choice& other) {
    return other.cost > chosen.cost + filter_rules::kEvidenceToFollow ||
           angle_between(other.X.q, chosen.X.q) < filter_rules::kOtherBranch_rad;
  });
  placed.X_WB = chosen.X;
  return !stays;
}

std::vector<ImagePlacement::Sighting> ImagePlacement::usable(int tag_id, int region) const {
  std::vector<Sighting> out;
  for (const Sighting& s : sightings_.at(tag_id)) {
    const Placed& placed = placed_[s.body][s.instant];
    if (placed.region == region && placed.is_sure) out.push_back(s);
  }
  return out;
}

double ImagePlacement::cost_of(const std::vector<Sighting>& sightings, const Pose& X_WT) const {
  double cost = 0;
  for (const Sighting& s : sightings) {
    const TagObservations& image = seen_[s.body][s.instant][s.image];
    const CameraMount& camera = cameras_[s.body][static_cast<std::size_t>(image.camera)];
    const SightedTag tag{s.seen, &camera.model, camera.X_BV, X_WT};
    cost += misfit({&tag, 1}, placed_[s.body][s.instant].X_WB, bodies_[s.body].corner_noise_px);
  }
  return cost;
}

std::optional<ImagePlacement::Choice> ImagePlacement::best_place(
    const std::vector<Sighting>& sightings, const std::optional<Pose>& now) const {
  std::vector<Sighting> largest = sightings;
  std::ranges::stable_sort(largest, [](const Sighting& a, const Sighting& b) {
    return size_px(*a.seen) > size_px(*b.seen);
  });
  const std::vector<Sighting> judging = thinned(sightings, kJudgingSightings);
  // Relative to the tag, all cameras are one rigid body.
  std::vector<SightedTag> from_tag;
  double noise_px = 0;
  const auto camera_of = [&](const Sighting& s) -> const CameraMount& {
    const TagObservations& image = seen_[s.body][s.instant][s.image];
    return cameras_[s.body][static_cast<std::size_t>(image.camera)];
  };
  for (const Sighting& s : judging) {
    const CameraMount& camera = camera_of(s);
    from_tag.push_back({s.seen, &camera.model, placed_[s.body][s.instant].X_WB * camera.X_BV, {}});
    noise_px = std::max(noise_px, bodies_[s.body].corner_noise_px);
  }
  std::vector<Choice> choices;
  const auto offer = [&](const Pose& X_WT) {
    const Pose better = improved(X_WT.inverse(), from_tag, noise_px).inverse();
    choices.push_back({better, cost_of(judging, better), false});
  };
  if (now) offer(*now);
  for (std::size_t i = 0; i < std::min(largest.size(), kProposingSightings); ++i) {
    const Sighting& s = largest[i];
    const Pose X_WV = placed_[s.body][s.instant].X_WB * camera_of(s).X_BV;
    for (const TagPose& pose : solve_tag_pose(*s.seen, camera_of(s).model))
      if (std::isfinite(pose.rms_px)) offer(X_WV * pose.X_VT);
  }
  if (choices.empty()) return std::nullopt;
  Choice best = *std::ranges::min_element(
      choices, [](const auto& a, const auto& b) { return a.cost < b.cost; });
  if (now && choices.front().cost - kBranchEvidence < best.cost) best = choices.front();
  best.is_sure = std::ranges::all_of(choices, [&](const Choice& other) {
    return other.cost > best.cost + kBranchEvidence ||
           angle_between(other.X.q, best.X.q) < filter_rules::kOtherBranch_rad;
  });
  const auto fitting = std::ranges::count_if(judging, [&](const Sighting& s) {
    return cost_of({s}, best.X) < kSightingBend * std::log(2.0);
  });
  best.is_sure &=
      static_cast<double>(fitting) >= kLeastFitting * static_cast<double>(judging.size());
  return best;
}

/// @return whether it has got another place
bool ImagePlacement::place_tag(int tag_id) {
  const auto known = tags_.find(tag_id);
  if (known != tags_.end()) {
    if (known->second.is_held) return false;
    const auto sightings = usable(tag_id, known->second.region);
    const Pose was = known->second.tag.X_WT;
    const auto best = best_place(sightings, was);
    if (!best || !best->is_sure || angle_between(best->X.q, was.q) < filter_rules::kOtherBranch_rad)
      return false;
    KnownTag tag = known->second.tag;
    tag.X_WT = best->X;
    put(tag, known->second.region, false);
    return true;
  }
  for (int region = 0; region < regions_; ++region) {
    const auto sightings = usable(tag_id, region);
    if (sightings.empty()) continue;
    const auto best = best_place(sightings, std::nullopt);
    if (!best || !best->is_sure) return false;
    put({tag_id, sightings.front().seen->edge_m, best->X, Matrix6d::Zero()}, region, false);
    return true;
  }
  return false;
}

}  // namespace fiducap
