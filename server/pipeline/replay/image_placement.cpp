#include "pipeline/replay/image_placement.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/numeric.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap {
namespace {

// Instants that propose a pose, and that judge it: more only cost time.
constexpr std::size_t kProposing = 8;
constexpr std::size_t kJudging = 40;
// Instants without doubt by which a tag begins a region alone.
constexpr std::ptrdiff_t kLeastSure = 5;
// Of a relation found by iteration: enough for a start, m and rad.
constexpr double kSameRelation = 1e-3;
constexpr int kMostIterations = 5;
// From one viewpoint, corners repeat themselves and show little noise.
constexpr double kLeastNoise_px = 0.05;

// Error of a neighbouring instant's pose, m and rad, beside the drift of odometry …
constexpr double kOfNeighbour = 0.1;
// … and of a body carried by hand without odometry: its motion within a second, which grows with
// the root of time.
constexpr double kMoves_m = 1.0;
constexpr double kTurns_rad = 0.5;

// m and rad: no information.
const PlaceGuess kAnywhere{{}, 1e6, 1e6};

double size_px(const SightedTag& tag) {
  return (tag.seen->corners_px[0] - tag.seen->corners_px[2]).norm();
}

CornerResidual residual(const SightedTag& tag, const Pose& X_AB) {
  return corner_residual(*tag.seen, (X_AB * tag.X_BV).inverse() * tag.X_AT, *tag.camera);
}

/// Squared residual in units of the noise; of a tag behind the camera: by the focal length.
double square_of(const SightedTag& tag, const Pose& X_AB, double noise_px) {
  const CornerResidual r = residual(tag, X_AB);
  const double square = r.in_front ? r.y.squaredNorm() : 8 * tag.camera->fu * tag.camera->fu;
  return square / (noise_px * noise_px);
}

const SightedTag& largest_of(const std::vector<SightedTag>& tags) {
  return *std::ranges::max_element(tags, {}, size_px);
}

}  // namespace

ImagePlacement::ImagePlacement(std::vector<BodyToPlace> bodies, double branch_evidence)
    : bodies_(std::move(bodies)), branch_evidence_(branch_evidence) {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    placed_.emplace_back();
    for (const LoggedInstant& instant : *bodies_[b].log) {
      const View& view = all_.emplace_back(View{b, placed_[b].size()});
      placed_[b].push_back({.at = instant.at, .X_WB = {}});
      std::set<int> ids;
      for (const TagObservations& image : instant.images)
        for (const TagObservation& tag : image.tags) ids.insert(tag.tag_id);
      for (const int tag_id : ids) sightings_[tag_id].push_back(view);
    }
  }
}

void ImagePlacement::put(const KnownTag& tag, int region, bool is_held) {
  if (const auto known = tags_.find(tag.tag_id); known != tags_.end() && known->second.is_held)
    return;
  tags_[tag.tag_id] = {tag, region, is_held};
  for (const View& view : sightings_[tag.tag_id]) placed_[view.body][view.instant].waits = true;
}

void ImagePlacement::take(std::size_t body, const std::vector<CameraBelief>& cameras,
                          std::span<const StampedPose> poses) {
  for (std::size_t c = 0; c < cameras.size(); ++c) bodies_[body].cameras[c].X_BV = cameras[c].X_BV;
  auto pose = poses.begin();
  for (Placed& placed : placed_[body]) {
    while (pose != poses.end() && pose->at < placed.at) ++pose;
    if (pose != poses.end() && pose->at == placed.at && placed.region == 0)
      placed.X_WB = pose->X_WB;
  }
}

double ImagePlacement::learn_noise(std::size_t body) {
  std::vector<double> squares;
  for (std::size_t i = 0; i < placed_[body].size(); ++i) {
    for (const SightedTag& tag : tags_at({body, i}, placed_[body][i].region)) {
      const CornerResidual r = residual(tag, placed_[body][i].X_WB);
      if (r.in_front) squares.push_back(r.y.squaredNorm());
    }
  }
  double& noise_px = bodies_[body].corner_noise_px;
  if (!squares.empty())
    noise_px = std::max(kLeastNoise_px,
                        std::sqrt(quantile(std::move(squares), 0.5) / chi_square_quantile(8, 0.5)));
  return noise_px;
}

std::vector<SightedTag> ImagePlacement::tags_at(const View& view, int axes) const {
  std::vector<SightedTag> out;
  for (const TagObservations& image : (*bodies_[view.body].log)[view.instant].images) {
    const CameraMount& camera = bodies_[view.body].cameras[static_cast<std::size_t>(image.camera)];
    for (const TagObservation& seen : image.tags) {
      const auto tag = tags_.find(seen.tag_id);
      if (alone(seen.tag_id) == axes)
        out.push_back({&seen, &camera.model, camera.X_BV, {}});
      else if (tag != tags_.end() && tag->second.region == axes)
        out.push_back({&seen, &camera.model, camera.X_BV, tag->second.tag.X_WT});
    }
  }
  return out;
}

/// The lowest region of the instant's tags.
int ImagePlacement::region_of(const View& view) const {
  int region = 0;
  while (region < regions_ && tags_at(view, region).empty()) ++region;
  return region < regions_ ? region : kNowhere;
}

/// By both neighbours in time: distinguishes poses that explain an instant equally well.
PlaceGuess ImagePlacement::guess_of(const View& view, int region) const {
  const auto& placed = placed_[view.body];
  const Placed& own = placed[view.instant];
  const Odometry* const odometry = bodies_[view.body].odometry;
  PlaceGuess guess = kAnywhere;
  for (const std::size_t i : {view.instant - 1, view.instant + 1}) {
    if (i >= placed.size() || placed[i].region != region) continue;
    const double root_s = std::sqrt(to_seconds(std::chrono::abs(placed[i].at - own.at)));
    PlaceGuess by{placed[i].X_WB, kMoves_m * std::max(1.0, root_s),
                  kTurns_rad * std::max(1.0, root_s)};
    const auto moved =
        odometry != nullptr ? odometry->motion(placed[i].at, own.at) : std::optional<Pose>{};
    if (moved)
      by = {placed[i].X_WB * *moved, std::hypot(kOfNeighbour, odometry->move_noise_m * root_s),
            std::hypot(kOfNeighbour, odometry->turn_noise_rad * root_s)};
    // The product of two distributions.
    const double sum_rad = std::hypot(guess.rotation_sigma_rad, by.rotation_sigma_rad);
    const double sum_m = std::hypot(guess.position_sigma_m, by.position_sigma_m);
    const double of_turn = std::pow(guess.rotation_sigma_rad / sum_rad, 2);
    const double of_place = std::pow(guess.position_sigma_m / sum_m, 2);
    guess = {{guess.X_AB.q.slerp(of_turn, by.X_AB.q),
              guess.X_AB.p + of_place * (by.X_AB.p - guess.X_AB.p)},
             guess.position_sigma_m * by.position_sigma_m / sum_m,
             guess.rotation_sigma_rad * by.rotation_sigma_rad / sum_rad};
  }
  return guess;
}

void ImagePlacement::place(const View& view) {
  Placed& placed = placed_[view.body][view.instant];
  placed.waits = false;
  const int region = region_of(view);
  if (region == kNowhere || (placed.region != kNowhere && placed.region < region)) return;
  const auto found = find_place(tags_at(view, region), guess_of(view, region),
                                bodies_[view.body].corner_noise_px, filter_rules::kOtherBranch_rad);
  if (!found) return;
  placed.is_sure = found->evidence > filter_rules::kEvidenceToFollow;
  // It stays in its branch without evidence for another one.
  if (!placed.is_sure && placed.region == region &&
      angle_between(found->X_AB.q, placed.X_WB.q) > filter_rules::kOtherBranch_rad)
    return;
  placed.region = region;
  placed.X_WB = found->X_AB;
}

/// Places instants beside a placed one by odometry, and their tags by them, in order of time: a tag
/// is placed by its first visit, and later visits by the tag.
/// @return whether anything was placed
bool ImagePlacement::follow_odometry(std::size_t body) {
  if (bodies_[body].odometry == nullptr) return false;
  auto& placed = placed_[body];
  const auto carry = [&](std::size_t from, std::size_t to) {
    if (placed[to].region != kNowhere || placed[from].region == kNowhere) return false;
    const auto moved = bodies_[body].odometry->motion(placed[from].at, placed[to].at);
    if (!moved) return false;
    placed[to] = {placed[to].at, placed[from].region, placed[from].X_WB * *moved, true};
    place({body, to});
    for (const TagObservations& image : (*bodies_[body].log)[to].images)
      for (const TagObservation& seen : image.tags) (void)place_tag(seen.tag_id);
    return true;
  };
  bool is_new = false;
  for (std::size_t i = 1; i < placed.size(); ++i) is_new |= carry(i - 1, i);
  for (std::size_t i = placed.size(); i-- > 1;) is_new |= carry(i, i - 1);
  return is_new;
}

/// @return whether it had no place before
bool ImagePlacement::place_tag(int tag_id) {
  if (tags_.contains(tag_id)) return false;
  for (int region = 0; region < regions_; ++region) {
    const auto X_WT = relate(region, alone(tag_id));
    if (!X_WT) continue;
    put(tag_at(tag_id, *X_WT), region, false);
    return true;
  }
  return false;
}

void ImagePlacement::grow() {
  for (bool is_new = true; is_new;) {
    is_new = false;
    tried_.clear();
    place_waiting();
    for (std::size_t b = 0; b < bodies_.size(); ++b) is_new |= follow_odometry(b);
    for (const auto& [tag_id, seen] : sightings_) is_new |= place_tag(tag_id);
  }
}

bool ImagePlacement::settle() {
  const auto before = minima();
  begun_.clear();
  tried_.clear();
  for (auto& body : placed_)
    for (Placed& placed : body) placed.waits = true;
  place_waiting();
  for (auto& [tag_id, tag] : tags_) {
    if (tag.is_held) continue;
    const auto X_WT = relate(tag.region, alone(tag_id));
    if (!X_WT || angle_between(X_WT->q, tag.tag.X_WT.q) < filter_rules::kOtherBranch_rad) continue;
    tag.tag.X_WT = *X_WT;
    put(tag.tag, tag.region, false);
  }
  do grow();
  while (begin() || join());
  return !std::ranges::equal(before, minima(), [](const auto& a, const auto& b) {
    return a.first == b.first &&
           angle_between(a.second.q, b.second.q) < filter_rules::kOtherBranch_rad;
  });
}

/// Begins with a surveyed tag, with odometry if there is nothing else, or with the tag that is seen
/// most often.
bool ImagePlacement::begin() {
  withdraw(regions_ - 1);
  for (const auto& [tag_id, tag] : surveyed_) {
    if (tags_.contains(tag_id) || !sightings_.contains(tag_id)) continue;
    put(tag, 0, false);
    return true;
  }
  for (const View& view : all_) {
    Placed& one = placed_[view.body][view.instant];
    const Odometry* const odometry = bodies_[view.body].odometry;
    if (!tags_.empty()) break;
    if (one.region != kNowhere || odometry == nullptr || !odometry->covers(one.at)) continue;
    one = {one.at, 0, odometry->pose_at(one.at), true};
    return is_by_odometry_ = true;
  }
  int most = -1;
  auto views = kLeastSure;
  for (const auto& [tag_id, sightings] : sightings_) {
    if (tags_.contains(tag_id) || begun_.contains(tag_id)) continue;
    const auto own = std::ranges::count_if(
        sightings, [&](const View& view) { return at(view).region == kNowhere; });
    if (own < views || (most >= 0 && own == views)) continue;
    most = tag_id;
    views = own;
  }
  if (most < 0) return false;
  begun_.insert(most);
  put(tag_at(most, {}), tags_.empty() ? 0 : regions_++, false);
  return true;
}

/// A region of one tag without enough instants that are sure.
void ImagePlacement::withdraw(int region) {
  std::vector<int> ids;
  for (const auto& [tag_id, tag] : tags_)
    if (tag.region == region) ids.push_back(tag_id);
  if (ids.size() != 1 || !begun_.contains(ids.front())) return;
  const auto& views = sightings_.at(ids.front());
  const auto sure = std::ranges::count_if(
      views, [&](const View& view) { return at(view).region == region && at(view).is_sure; });
  if (sure >= kLeastSure) return;
  tags_.erase(ids.front());
  for (const View& view : views)
    if (at(view).region == region) placed_[view.body][view.instant].region = kNowhere;
  if (region > 0) --regions_;
}

void ImagePlacement::move(int region, int into, const Pose& T) {
  for (auto& [tag_id, one] : tags_)
    if (one.region == region) put(tag_at(tag_id, T * one.tag.X_WT), into, false);
  for (std::vector<Placed>& body : placed_) {
    for (Placed& placed : body) {
      if (placed.region != region) continue;
      placed.region = into;
      placed.X_WB = T * placed.X_WB;
    }
  }
}

void ImagePlacement::define_workspace(const WorkspaceGauge& gauge) {
  if (!is_by_odometry_) return;
  const auto tag = gauge.reference_tag ? tags_.find(*gauge.reference_tag) : tags_.begin();
  if (tag == tags_.end() || tag->second.region != 0) return;
  const Pose& X_WT = tag->second.tag.X_WT;
  const HeadingRule rule = make_heading_rule(gauge, X_WT.q);
  // Odometry knows the vertical.
  const Eigen::Quaterniond turn = turn_to_heading(rule, X_WT.q);
  move(0, 0, {turn, rule.X_WT.p - turn * X_WT.p});
  is_by_odometry_ = false;
}

/// Possible poses of a body.
std::vector<Pose> ImagePlacement::bodies_at(const View& view, int axes) const {
  if (at(view).region == axes && at(view).is_sure) return {at(view).X_WB};
  const SightedTag tag = largest_of(tags_at(view, axes));
  std::vector<Pose> out;
  for (const TagPose& pose : solve_tag_pose(*tag.seen, *tag.camera))
    if (std::isfinite(pose.rms_px)) out.push_back(tag.X_AT * (tag.X_BV * pose.X_VT).inverse());
  return out;
}

/// Axes b in a, by instants that are in a and see a tag of b: the only pose that explains them.
std::optional<Pose> ImagePlacement::relate(int a, int b) {
  std::vector<View> views;
  bool is_sure = false;
  for (const View& view : b < kNowhere ? sightings_.at(alone(b)) : all_) {
    if (at(view).region != a || tags_at(view, b).empty()) continue;
    views.push_back(view);
    is_sure |= at(view).is_sure;
  }
  // Nothing is learned of a tag by instants that are placed by it.
  if (!is_sure && b < kNowhere && tags_.contains(alone(b))) return std::nullopt;
  // Between regions the body is placed by both: with a poor lens neither fits the other's poses.
  const bool is_fixed = is_sure && b < kNowhere;
  if (is_fixed) std::erase_if(views, [&](const View& view) { return !at(view).is_sure; });
  auto& tried = tried_[{a, b}];
  if (views.empty() || tried == views.size()) return std::nullopt;
  tried = views.size();
  std::vector<View> near = views;
  std::ranges::stable_sort(near, std::greater{},
                           [&](const View& view) { return size_px(largest_of(tags_at(view, b))); });
  near.resize(std::min(near.size(), kProposing));
  std::vector<Way> ways;
  for (const View& view : near)
    for (const Pose& X_aB : bodies_at(view, a))
      for (const Pose& X_bB : bodies_at(view, b)) ways.push_back({X_aB * X_bB.inverse(), 0, false});
  views = thinned(views, kJudging);
  for (Way& way : ways) judge(way, a, b, views, is_fixed);
  if (ways.empty()) return std::nullopt;
  const Way& best = *std::ranges::min_element(ways, {}, &Way::cost);
  const bool is_only = std::ranges::all_of(ways, [&](const Way& way) {
    return way.cost > best.cost + branch_evidence_ ||
           angle_between(way.X.q, best.X.q) < filter_rules::kOtherBranch_rad;
  });
  return is_only && best.fits ? std::optional(best.X) : std::nullopt;
}

/// Improves a relation and sets its cost. Relative to b all cameras are one rigid body.
void ImagePlacement::judge(Way& way, int a, int b, const std::vector<View>& views,
                           bool is_fixed) const {
  for (int iteration = 0;; ++iteration) {
    std::vector<SightedTag> from_b;
    double noise_px = 0;
    way.cost = 0;
    int fitting = 0;
    for (const View& view : views) {
      const double own_px = bodies_[view.body].corner_noise_px;
      const std::vector<SightedTag> there = tags_at(view, b);
      std::vector<SightedTag> all;
      if (!is_fixed) all = tags_at(view, a);
      for (SightedTag tag : there) {
        tag.X_AT = way.X * tag.X_AT;
        all.push_back(tag);
      }
      Pose X_aB = at(view).X_WB;
      if (!is_fixed) {
        if (const auto found = find_place(all, kAnywhere, own_px)) X_aB = found->X_AB;
      }
      for (const SightedTag& tag : all) {
        const double bent = square_of(tag, X_aB, own_px) / filter_rules::kLossBend;
        way.cost += filter_rules::kLossBend * std::log1p(bent);
        fitting += bent < 1 ? 1 : -1;
      }
      for (const SightedTag& tag : there)
        from_b.push_back({tag.seen, tag.camera, X_aB * tag.X_BV, tag.X_AT});
      noise_px = std::max(noise_px, own_px);
    }
    way.fits = fitting >= 0;
    if (iteration == kMostIterations) return;
    Pose next = way.X.inverse();
    for (const double sigmas : {50.0, 5.0}) next = resect(next, from_b, sigmas * noise_px);
    const Pose step = way.X * next;
    if (step.p.norm() < kSameRelation && angle_between(step.q, {}) < kSameRelation) return;
    way.X = next.inverse();
  }
}

}  // namespace fiducap
