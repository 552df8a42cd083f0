// TagFilter: contradicting images, removal of tags and relocalisation.
#include <algorithm>
#include <array>

#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/update/tag_filter.hpp"
#include "estimation/world/corner_measurement.hpp"

namespace fiducap {

using namespace world;         // NOLINT: the state and its operations
using namespace filter_rules;  // NOLINT: short names

namespace {
// Sightings after which a tag is proven, and proven others that confirm the filter against a single
// tag.
constexpr int kProvenOthers = 2;
constexpr int kSightingsToBeProven = 20;
// Time and position uncertainty up to which the IMU keeps the place better than a tag's move.
constexpr double kPlaceKept_s = 6.0;
constexpr double kPlaceKept_m = 0.1;
// Proven tags that may be removed by the body's own estimate until a proven tag is accepted; with
// more of them the body is wrong. Other tags do not count: few images initialised them.
constexpr std::ptrdiff_t kMostUnconfirmed = 2;
// Consecutive images without an accepted tag before the pose is ambiguous.
constexpr int kContradictionsToDoubt = 5;
// Gap and position uncertainty after which a relocalisation by a single tag is monitored.
constexpr double kGap_s = 0.5;
constexpr double kMayBeMoved_m = 0.06;
// Position uncertainty of a body that is not published (BodyLimits).
constexpr double kPlaceUnknown_m = 0.25;
// Relocalisations without a consistent period in between, before everything is restarted.
constexpr int kMostRelocalisations = 4;
constexpr int kImagesToTrust = 40;
// Consistent images after which the contradicting tags were moved, when no other tag comes into
// view. An inconsistent image subtracts kTakenBack: a gate rejects some by chance.
constexpr int kImagesToDecide = 600;
constexpr int kTakenBack = 60;
// A single tag that contradicted before, or whose rotation differs from the gyroscope's by this,
// relocalises the body only after these images.
constexpr double kMostTurn_rad = 0.15;
constexpr int kDoubtfulAttempts = 160;
// IMU propagation up to which a clock jump can be found.
constexpr double kJumpBridged_s = 1.5;
// Position uncertainty above which a clock jump cannot be distinguished.
constexpr double kPlaceForJumpSearch_m = 0.1;
// Time after a contradiction for which images are collected.
constexpr double kSearchLasts_s = 1.0;
// Clock after a jump found by directions, and found by rotations of camera and gyroscope (17 jumps
// of 0.6 s: 0.024 s RMS).
constexpr double kJumpSigma_s = 0.01;
constexpr double kJumpByTurnsSigma_s = 0.03;
// Consecutive images with usable tags and none accepted, before tags are removed or the body is
// relocalised.
constexpr int kRejectedToRelocalise = 20;
// The same when all of them show a single tag, which may have been moved, and an IMU bridges it.
constexpr double kOneTagTimeout_s = 8.0;
}  // namespace

/// Finds a clock jump: contradicting images that fit the IMU's path at another time.
void TagFilter::look_for_jump(const TagObservations& seen, UpdateReport& report) {
  may_have_jumped_ = false;
  if (!has_imu() || !is_start_over_ || !is_following()) return;
  if (!config_.estimate_clocks) return;
  if (contradictions_.seconds_without_fit(seen.exposed_at) > kJumpBridged_s) return;
  if (report.tags_dropped > 0) tags_.find_again(state_);
  const int contradicting = contradictions_.contradicting_images_of(seen.camera);
  if (contradicting > 0) contradicted_at_ = seen.exposed_at;
  if (!contradicted_at_ || tags_.usable.empty()) return;
  if (to_seconds(seen.exposed_at - *contradicted_at_) > kSearchLasts_s) {
    contradicted_at_.reset();
    return jump_search_.forget_images();
  }
  jump_search_.note_image(seen.camera, seen.exposed_at - seen.clock_shift,
                          image_update_.sighted(state_, seen.camera, tags_.usable));
  if (contradicting < kContradictionsToReopenClock) return;
  if (image_update_.place(state_).sigma_m() > kPlaceForJumpSearch_m) return;
  const auto found = jump_search_.find(seen.camera, seen.clock_shift);
  may_have_jumped_ = found.has_value();
  if (!found || !found->is_certain) return;
  const double shift_s = to_seconds(seen.clock_shift) + found->shift_s;
  set_clock(seen.camera, shift_s, kJumpSigma_s);
  reset_outlier_counters();
  report.clock_jump = UpdateReport::ClockJump{seen.camera, shift_s, found->shift_s};
}

/// Sets a clock after a jump and discards the noise learned from the last images.
void TagFilter::set_clock(int camera, double shift_s, double sigma_s) {
  image_update_.note_clock_jump(state_);
  if (!config_.estimate_clocks || !has_imu()) return;
  state_.clocks[static_cast<std::size_t>(camera)].shift_s = shift_s;
  open_clock(state_, sensors_, config_, camera, sigma_s);
}

/// After a clock jump: the removals since then were wrong.
void TagFilter::reset_outlier_counters() {
  memory_.forget_all();
  unstable_tags_.forget_all();
  unconfirmed_removals_.clear();
  ambiguous_offset_W_.reset();
  single_tag_.forget();
  contradictions_.reset();
  jump_search_.forget_images();
  contradicted_at_.reset();
  may_have_jumped_ = false;
}

void TagFilter::handle_outliers(const TagObservations& seen, UpdateReport& report) {
  // The start search handles contradictions of a young filter; the clock of an old one has jumped.
  if (is_start_over_ && contradictions_.contradicting_images() == kContradictionsToReopenClock) {
    const auto camera = static_cast<std::size_t>(seen.camera);
    open_clock(state_, sensors_, config_, seen.camera, sensors_.cameras[camera].time_shift_sigma_s);
    contradictions_.reset_tag_scores();
    memory_.forget_all();
  }
  const int factor = may_have_jumped_ ? 2 : 1;
  if (contradictions_.images_without_fit() < factor * kRejectedToRelocalise) return;
  if (!has_imu() || !is_start_over_) return restart();
  // The body's place is better known than by a tag that may have been moved.
  const double gap_s = contradictions_.seconds_without_fit(seen.exposed_at);
  const bool is_place_kept = is_following() && contradictions_.has_ever_fit() &&
                             gap_s < kPlaceKept_s &&
                             image_update_.place(state_).sigma_m() < kPlaceKept_m;
  const auto unconfirmed =
      std::ranges::count_if(unconfirmed_removals_, &RemovedTag::was_proven) +
      std::ranges::count_if(tags_.usable, [&](const TagToUse& tag) { return is_proven(tag); });
  if (is_place_kept && unconfirmed <= kMostUnconfirmed) {
    for (const TagToUse& tag : tags_.usable) {
      unconfirmed_removals_.push_back({tag.seen->tag_id, is_proven(tag)});
      discard_tag(tag.seen->tag_id, seen.exposed_at, report);
    }
    return contradictions_.reset();
  }
  const bool is_alive = contradictions_.has_ever_fit() && gap_s < kOneTagTimeout_s;
  if (is_alive && only_one_outlier_tag()) return;
  begin_relocalisation(seen, report);
}

void TagFilter::note_clock_jump(int camera, Duration shift) {
  set_clock(camera, to_seconds(shift), kJumpByTurnsSigma_s);
  reset_outlier_counters();
  contradictions_.forget_all();
  lose_motion(false);
}

/// Keeps the state except for tags removed without confirmation: the body was wrong.
void TagFilter::begin_relocalisation(const TagObservations& seen, UpdateReport& report) {
  if (++relocalisations_ > kMostRelocalisations) return restart();
  report.relocalised = true;
  images_trusted_ = 0;
  const std::vector<RemovedTag> doubtful = std::move(unconfirmed_removals_);
  unconfirmed_removals_.clear();
  for (const RemovedTag& one : doubtful) discard_tag(one.tag_id, seen.exposed_at, report);
  lose_motion(false);
  contradictions_.reset();
}

/// All contradictions are by the same tag.
bool TagFilter::only_one_outlier_tag() const {
  const TagScores& scores = contradictions_.scores();
  std::ptrdiff_t proven = 0;
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const auto& tag = state_.tags[i];
    const bool proven_tag = !is_own(i) || tag.sightings >= kSightingsToBeProven;
    proven += proven_tag && !scores.is_doubtful(tag.tag_id) ? 1 : 0;
  }
  return has_imu() && is_start_over_ &&
         std::ranges::all_of(tags_.usable, [](const TagToUse& tag) { return tag.local >= 0; }) &&
         scores.doubtful() == 1 && proven >= kProvenOthers;
}

void TagFilter::discard_tag(int tag_id, Instant at, UpdateReport& report) {
  const int tag = state_.find(tag_id);
  if (tag >= 0) {
    image_update_.discard_noise_learned_since_outlier(state_);
    // Moved tags of the map are handled by the map.
    if (is_own(static_cast<std::size_t>(tag))) unstable_tags_.note_removal(tag_id, at);
    state_.remove_tag(static_cast<std::size_t>(tag));
  }
  memory_.forget_tag(tag_id);
  candidates_.forget(tag_id);
  anchor_.forget_tag(tag_id);
  report.name_dropped(tag_id);
}

/// An accepted sighting of a proven tag confirms earlier removals.
void TagFilter::confirm_removals() {
  bool fits = false;
  bool is_confirmed = false;
  for (std::size_t i = 0; i < tags_.usable.size(); ++i) {
    if (!tags_.accepted[i]) continue;
    const TagToUse& tag = tags_.usable[i];
    const auto is_same = [&](const RemovedTag& one) { return one.tag_id == tag.seen->tag_id; };
    fits = true;
    is_confirmed |= is_proven(tag) && std::ranges::none_of(unconfirmed_removals_, is_same);
  }
  images_trusted_ = fits ? images_trusted_ + 1 : std::max(0, images_trusted_ - kTakenBack);
  if (images_trusted_ >= kImagesToTrust) relocalisations_ = 0;
  if (is_confirmed || images_trusted_ >= kImagesToDecide) {
    unconfirmed_removals_.clear();
    ambiguous_offset_W_.reset();
  }
}

/// Sets the ambiguous offset when all tags in view contradict: either they were moved or the body
/// is at another place.
void TagFilter::update_ambiguity(const TagObservations& seen) {
  if (!has_imu() || !is_start_over_) return;
  if (contradictions_.images_without_fit() == 0 && unconfirmed_removals_.empty())
    ambiguous_offset_W_.reset();
  if (contradictions_.images_without_fit() < kContradictionsToDoubt) return;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int tags = 0;
  for (const TagToUse& tag : tags_.usable) {
    const auto shift_W = is_proven(tag) ? shift_by(seen, tag) : std::nullopt;
    if (!shift_W) continue;
    sum += *shift_W;
    ++tags;
    ambiguous_tag_ = tag.seen->tag_id;
  }
  if (tags > 0) ambiguous_offset_W_ = sum / tags;
}

bool TagFilter::is_proven(const TagToUse& tag) const {
  const int local = state_.find(tag.seen->tag_id);
  if (local < 0) return tag.known != nullptr;
  return !is_own(static_cast<std::size_t>(local)) ||
         state_.tags[static_cast<std::size_t>(local)].sightings >= kSightingsToBeProven;
}

/// Monitors a single tag that determined the place after a gap: it may have been moved meanwhile.
void TagFilter::check_single_tag_relocalisation(const TagObservations& seen, UpdateReport& report) {
  if (!has_imu()) return;
  const bool is_alone = tags_.usable.size() == 1 && tags_.accepted.front();
  report.relocalised_by_one_tag = is_alone && place_before_.sigma_m() > kPlaceUnknown_m;
  if (!is_start_over_) return;
  if (!single_tag_.is_watched() && is_alone && gap_before_s_ > kGap_s &&
      place_before_.sigma_m() > kMayBeMoved_m)
    single_tag_.begin(tags_.usable.front().seen->tag_id, place_before_, state_.X_WB.p);
  if (!single_tag_.is_watched()) return;
  std::array<int, UpdateReport::kMostNamed> against{};
  std::size_t count = 0;
  std::optional<Eigen::Vector3d> shift_W;
  for (std::size_t i = 0; i < tags_.usable.size() && count < against.size(); ++i) {
    const TagToUse& tag = tags_.usable[i];
    if (tag.seen->tag_id == single_tag_.tag_id() || !is_proven(tag)) continue;
    if (tags_.accepted[i]) return single_tag_.forget();
    if (count == 0) shift_W = shift_by(seen, tag);
    against[count++] = tag.seen->tag_id;
  }
  if (count == 0) return;
  const auto ids = std::span<const int>(against).first(count);
  const auto verdict = single_tag_.contradict(ids, shift_W);
  if (verdict == SingleTagRelocalisation::Verdict::kOpen) return;
  const int tag_id = single_tag_.tag_id();
  single_tag_.forget();
  if (verdict == SingleTagRelocalisation::Verdict::kOthersWrong) {
    for (const int other : ids) discard_tag(other, seen.exposed_at, report);
    return contradictions_.reset();
  }
  discard_tag(tag_id, seen.exposed_at, report);
  begin_relocalisation(seen, report);
}

bool TagFilter::relocalise(const TagObservations& seen) {
  if (!pose_finder_.knows_attitude()) return false;
  const auto found = pose_finder_.find(state_, seen.exposed_at,
                                       image_update_.sighted(state_, seen.camera, tags_.usable),
                                       image_update_.noise(seen.camera).unexplained_px());
  ++relocalisation_attempts_;
  const bool is_forced = has_imu() && relocalisation_attempts_ >= kForceWithImu;
  if (found && (found->evidence >= config_.branch_evidence || is_forced)) {
    if (is_relocalisation_doubtful(found->X_AB, seen.exposed_at)) return false;
    jump(found->X_AB, seen.exposed_at);
    if (tags_.usable.size() == 1)
      single_tag_.begin(tags_.usable.front().seen->tag_id, std::nullopt, found->X_AB.p);
    return true;
  }
  return relocalise_by_views(seen);
}

/// A moved tag or an ambiguous id must not relocalise the body.
bool TagFilter::is_relocalisation_doubtful(const Pose& X_WB, Instant at) const {
  if (!has_imu() || tags_.usable.size() != 1 || relocalisation_attempts_ >= kDoubtfulAttempts)
    return false;
  if (contradictions_.scores().is_doubtful(tags_.usable.front().seen->tag_id)) return true;
  return !pose_finder_.is_turn_lost() &&
         angle_between(pose_finder_.turned(state_, at).q, X_WB.q) > kMostTurn_rad;
}

bool TagFilter::relocalise_by_views(const TagObservations& seen) {
  for (const TagToUse& tag : tags_.usable) {
    const auto verdict = judge(seen, tag, ViewLimits{});
    if (!verdict) continue;
    const Pose X_BT = state_.X_BV[static_cast<std::size_t>(seen.camera)] * verdict->X_VT;
    const Pose X_WB = place_of(state_, tag) * X_BT.inverse();
    if (is_relocalisation_doubtful(X_WB, seen.exposed_at)) return false;
    jump(X_WB, seen.exposed_at);
    single_tag_.begin(tag.seen->tag_id, std::nullopt, state_.X_WB.p);
    return true;
  }
  return false;
}

}  // namespace fiducap
