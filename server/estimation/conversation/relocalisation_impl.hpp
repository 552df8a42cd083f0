#pragma once

// What a filter does when images contradict it: which tags it gives up, and how a body that is lost
// is found again in what was learned; a part of FilterConversation.
#include <algorithm>
#include <array>

#include "base/so3.hpp"
#include "estimation/conversation/filter_conversation.hpp"

namespace fiducap {

namespace filter_rules {
// So many others, seen so often, say that the filter is right and a lone tag wrong, if it is not
// young.
inline constexpr int kProvenOthers = 2;
inline constexpr int kSightingsToBeProven = 20;
// The IMU alone carries a body for so long without losing its place by more than a tag's move.
inline constexpr double kPlaceKept_s = 6.0;
inline constexpr double kPlaceKept_m = 0.1;
// So many proven tags may be given up by what the body itself knows, until a proven one fits again:
// more of them, and it is the body that is wrong. Young ones do not count: where they stand is what
// a few images said, glaring ones perhaps.
inline constexpr std::ptrdiff_t kMostUnwitnessed = 2;
// Images in a row of which nothing fits, before the pose is as unsure as they are apart from it.
inline constexpr int kContradictionsToDoubt = 5;
// A tag that alone brought the body back is on probation when it could have moved the body so far:
// after a gap, and by the body's own uncertainty before it was used.
inline constexpr double kGap_s = 0.5;
inline constexpr double kMayBeMoved_m = 0.06;
// A body that does not know its place better than this is not shown (BodyLimits).
inline constexpr double kPlaceUnknown_m = 0.25;
// A body that was found anew so often, and never fitted for long, is wrong in a way that what was
// learned cannot mend.
inline constexpr int kMostRelocalisations = 4;
inline constexpr int kImagesToTrust = 40;
// Where nobody else ever comes into view, so many that fit decide that tags were moved. One that
// does not takes back so many: a gate rejects some by chance.
inline constexpr int kImagesToDecide = 600;
inline constexpr int kTakenBack = 60;
// A lone tag that contradicted before, or that would turn the body against the gyro by this, brings
// it back only when so many images have shown nothing better.
inline constexpr double kMostTurn_rad = 0.15;
inline constexpr int kDoubtedReturns = 160;
// Readings alone say so long where the body was, to tell whether a clock has jumped.
inline constexpr double kJumpBridged_s = 1.5;
// A body that knows its own place no better than this, as after a start that went wrong, is moved
// by a shift of the clock as by anything else.
inline constexpr double kPlaceToTellJump_m = 0.1;
// After a contradiction images are kept for so long, to be looked at with the next ones.
inline constexpr double kSuspected_s = 1.0;
// Of a clock after it was found to have jumped.
inline constexpr double kJumpSigma_s = 0.01;
// … by the turns of camera and gyro alone: 17 jumps of 0.6 s were off by 0.024 s, RMS.
inline constexpr double kJumpByTurnsSigma_s = 0.03;
}  // namespace filter_rules

/// The readings say where the body was: images that fit there at another time tell that their clock
/// has jumped, long before tags or the body are doubted.
template <class C>
void FilterConversation<C>::look_for_jump(const TagObservations& seen, UpdateReport& report) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  may_have_jumped_ = false;
  if (!C::kRemembersImages || !has_imu() || !is_start_over_ || !is_following()) return;
  if (!follower_.config().estimate_clocks) return;
  if (contradictions_.seconds_without_fit(seen.exposed_at) > kJumpBridged_s) return;
  if (report.tags_dropped > 0) tags_.find_again(state());
  const int contradicting = contradictions_.contradicting_images_of(seen.camera);
  if (contradicting > 0) suspected_at_ = seen.exposed_at;
  if (!suspected_at_ || tags_.usable.empty()) return;
  if (to_seconds(seen.exposed_at - *suspected_at_) > kSuspected_s) {
    suspected_at_.reset();
    return follower_.jump_search().forget_images();
  }
  follower_.jump_search().note_image(seen.camera, seen.exposed_at - seen.clock_shift,
                                     coordinates().sighted(seen.camera, tags_.usable));
  if (contradicting < kContradictionsToReopenClock) return;
  if (coordinates().place().sigma_m() > kPlaceToTellJump_m) return;
  const auto found = follower_.jump_search().find(seen.camera, seen.clock_shift);
  may_have_jumped_ = found.has_value();
  if (!found || !found->is_certain) return;
  const double shift_s = to_seconds(seen.clock_shift) + found->shift_s;
  coordinates().set_clock(seen.camera, shift_s, kJumpSigma_s);
  pardon_all();
  report.clock_jump = UpdateReport::ClockJump{seen.camera, shift_s, found->shift_s};
}

/// The clock was wrong, not what was given up since.
template <class C>
void FilterConversation<C>::pardon_all() {
  coordinates().forget_past();
  restless_.forget_all();
  unwitnessed_.clear();
  elsewhere_W_.reset();
  return_.forget();
  contradictions_.pardon();
  follower_.jump_search().forget_images();
  suspected_at_.reset();
  may_have_jumped_ = false;
}

template <class C>
void FilterConversation<C>::answer_contradictions(const TagObservations& seen,
                                                  UpdateReport& report) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  // A young filter that contradicts itself is started again from another hypothesis; an old one had
  // a good clock, which must have jumped.
  if (is_start_over_ && contradictions_.contradicting_images() == kContradictionsToReopenClock) {
    const auto camera = static_cast<std::size_t>(seen.camera);
    coordinates().open_clock(seen.camera, follower_.sensors().cameras[camera].time_shift_sigma_s);
    contradictions_.pardon_tags();
    coordinates().forget_past();
  }
  const int patience = may_have_jumped_ ? 2 : 1;
  if (contradictions_.images_without_fit() < patience * kRejectedToRelocalise) return;
  if (!has_imu() || !is_start_over_) return restart();
  if (is_place_kept(seen.exposed_at) && may_give_up_usable()) {
    for (const TagToUse& tag : tags_.usable) {
      unwitnessed_.push_back({tag.seen->tag_id, is_proven(tag)});
      give_up(tag.seen->tag_id, seen.exposed_at, report);
    }
    return contradictions_.pardon();
  }
  const bool is_patient = contradictions_.has_ever_fit() &&
                          contradictions_.seconds_without_fit(seen.exposed_at) < kOneTagPatience_s;
  if (is_patient && is_one_tag_against_all()) return;
  relocalise(seen, report);
}

template <class C>
void FilterConversation<C>::note_clock_jump(int camera, Duration shift) {
  coordinates().set_clock(camera, to_seconds(shift), filter_rules::kJumpByTurnsSigma_s);
  pardon_all();
  contradictions_.forget_all();
  lose_motion(false);
}

/// Everything that was learned stays, but for tags that were placed by a body that is wrong.
template <class C>
void FilterConversation<C>::relocalise(const TagObservations& seen, UpdateReport& report) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  if (++relocalisations_ > kMostRelocalisations) return restart();
  report.relocalised = true;
  images_trusted_ = 0;
  const std::vector<GivenUpTag> doubtful = std::move(unwitnessed_);
  unwitnessed_.clear();
  for (const GivenUpTag& one : doubtful) give_up(one.tag_id, seen.exposed_at, report);
  lose_motion(false);
  contradictions_.pardon();
}

/// Images contradict, but all by the same tag.
template <class C>
bool FilterConversation<C>::is_one_tag_against_all() const {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  const TagScores& scores = contradictions_.scores();
  std::ptrdiff_t proven = 0;
  for (std::size_t i = 0; i < state().tags.size(); ++i) {
    const auto& tag = state().tags[i];
    const bool is_proven = !coordinates().is_own(i) || tag.sightings >= kSightingsToBeProven;
    proven += is_proven && !scores.is_suspect(tag.tag_id) ? 1 : 0;
  }
  return has_imu() && is_start_over_ &&
         std::all_of(tags_.usable.begin(), tags_.usable.end(),
                     [](const TagToUse& tag) { return tag.local >= 0; }) &&
         scores.suspects() == 1 && proven >= kProvenOthers;
}

/// The body knows where it is better than a moved tag could say.
template <class C>
bool FilterConversation<C>::is_place_kept(Instant now) const {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  return is_following() && contradictions_.has_ever_fit() &&
         contradictions_.seconds_without_fit(now) < kPlaceKept_s &&
         coordinates().place().sigma_m() < kPlaceKept_m;
}

template <class C>
bool FilterConversation<C>::may_give_up_usable() const {
  const auto before = std::count_if(unwitnessed_.begin(), unwitnessed_.end(),
                                    [](const GivenUpTag& one) { return one.was_proven; });
  const auto now = std::count_if(tags_.usable.begin(), tags_.usable.end(),
                                 [&](const TagToUse& tag) { return is_proven(tag); });
  return before + now <= filter_rules::kMostUnwitnessed;
}

template <class C>
void FilterConversation<C>::give_up(int tag_id, Instant at, UpdateReport& report) {
  const int tag = state().find(tag_id);
  if (tag >= 0) {
    coordinates().convict_tag();
    // What the map holds, the map takes back.
    if (coordinates().is_own(static_cast<std::size_t>(tag))) restless_.note_given_up(tag_id, at);
    coordinates().state().remove_tag(static_cast<std::size_t>(tag));
  }
  coordinates().forget_past_of(tag_id);
  candidates_.forget(tag_id);
  anchor_.forget_tag(tag_id);
  report.name_dropped(tag_id);
}

/// A proven tag that fits bears witness to all that was done without one.
template <class C>
void FilterConversation<C>::note_witnesses() {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  bool fits = false;
  for (std::size_t i = 0; i < tags_.usable.size(); ++i) {
    const TagToUse& tag = tags_.usable[i];
    fits = fits || tags_.accepted[i];
    const auto is_same = [&](const GivenUpTag& one) { return one.tag_id == tag.seen->tag_id; };
    if (tags_.accepted[i] && is_proven(tag) &&
        std::none_of(unwitnessed_.begin(), unwitnessed_.end(), is_same)) {
      unwitnessed_.clear();
      elsewhere_W_.reset();
    }
  }
  images_trusted_ = fits ? images_trusted_ + 1 : std::max(0, images_trusted_ - kTakenBack);
  if (images_trusted_ >= kImagesToTrust) relocalisations_ = 0;
  if (images_trusted_ >= kImagesToDecide) {
    unwitnessed_.clear();
    elsewhere_W_.reset();
  }
}

/// All that is seen contradicts: either it was moved, or the body is elsewhere. Until another tag
/// decides, the pose is as unsure as they are apart.
template <class C>
void FilterConversation<C>::note_elsewhere(const TagObservations& seen) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  if (!has_imu() || !is_start_over_) return;
  if (contradictions_.images_without_fit() == 0 && unwitnessed_.empty()) elsewhere_W_.reset();
  if (contradictions_.images_without_fit() < kContradictionsToDoubt) return;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int tags = 0;
  for (const TagToUse& tag : tags_.usable) {
    const auto shift_W = is_proven(tag) ? follower_.shift_by(seen, tag) : std::nullopt;
    if (!shift_W) continue;
    sum += *shift_W;
    ++tags;
    elsewhere_tag_ = tag.seen->tag_id;
  }
  if (tags > 0) elsewhere_W_ = sum / tags;
}

template <class C>
bool FilterConversation<C>::is_proven(const TagToUse& tag) const {
  const int local = state().find(tag.seen->tag_id);
  if (local < 0) return tag.known != nullptr;
  return !coordinates().is_own(static_cast<std::size_t>(local)) ||
         state().tags[static_cast<std::size_t>(local)].sightings >=
             filter_rules::kSightingsToBeProven;
}

/// One tag alone said where the body is after a gap: it may have been moved meanwhile. Proven ones
/// decide.
template <class C>
void FilterConversation<C>::watch_return(const TagObservations& seen, UpdateReport& report) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  if (!has_imu()) return;
  const bool is_alone = tags_.usable.size() == 1 && tags_.accepted.front();
  report.returned_alone = is_alone && place_before_.sigma_m() > kPlaceUnknown_m;
  if (!is_start_over_) return;
  if (!return_.is_watched() && is_alone && gap_before_s_ > kGap_s &&
      place_before_.sigma_m() > kMayBeMoved_m)
    return_.begin(tags_.usable.front().seen->tag_id, place_before_, coordinates().X_WB().p);
  if (!return_.is_watched()) return;
  std::array<int, UpdateReport::kMostNamed> against{};
  std::size_t count = 0;
  std::optional<Eigen::Vector3d> shift_W;
  for (std::size_t i = 0; i < tags_.usable.size() && count < against.size(); ++i) {
    const TagToUse& tag = tags_.usable[i];
    if (tag.seen->tag_id == return_.tag_id() || !is_proven(tag)) continue;
    if (tags_.accepted[i]) return return_.forget();
    if (count == 0) shift_W = follower_.shift_by(seen, tag);
    against[count++] = tag.seen->tag_id;
  }
  if (count == 0) return;
  const auto ids = std::span<const int>(against).first(count);
  answer_return(seen, return_.contradict(ids, shift_W), ids, report);
}

template <class C>
void FilterConversation<C>::answer_return(const TagObservations& seen, LoneReturn::Verdict verdict,
                                          std::span<const int> against, UpdateReport& report) {
  if (verdict == LoneReturn::Verdict::kOpen) return;
  const int tag_id = return_.tag_id();
  return_.forget();
  if (verdict == LoneReturn::Verdict::kOthersWrong) {
    for (const int other : against) give_up(other, seen.exposed_at, report);
    return contradictions_.pardon();
  }
  give_up(tag_id, seen.exposed_at, report);
  relocalise(seen, report);
}

template <class C>
void FilterConversation<C>::lose_motion(bool is_turn_lost) {
  if (!is_following()) return;
  if (!running()) return restart();
  elsewhere_W_.reset();
  follower_.lose_motion(is_turn_lost);
  candidates_.forget_all();
  return_attempts_ = 0;
}

template <class C>
bool FilterConversation<C>::come_back(const TagObservations& seen) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  if (!follower_.knows_attitude()) return false;
  const auto found = follower_.find_place(seen, tags_.usable);
  ++return_attempts_;
  const bool is_forced = has_imu() && return_attempts_ >= kForceWithImu;
  if (found && (found->evidence >= follower_.config().branch_evidence || is_forced)) {
    if (is_return_doubtful(found->X_AB, seen.exposed_at)) return false;
    jump(found->X_AB, seen.exposed_at);
    if (tags_.usable.size() == 1)
      return_.begin(tags_.usable.front().seen->tag_id, std::nullopt, found->X_AB.p);
    return true;
  }
  return come_back_by_views(seen);
}

/// A moved tag, or an id that is there twice, must not say where the body is.
template <class C>
bool FilterConversation<C>::is_return_doubtful(const Pose& X_AB, Instant at) const {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  if (!has_imu() || tags_.usable.size() != 1 || return_attempts_ >= kDoubtedReturns) return false;
  if (contradictions_.scores().is_suspect(tags_.usable.front().seen->tag_id)) return true;
  return !follower_.is_turn_lost() && angle_between(follower_.turned(at).q, X_AB.q) > kMostTurn_rad;
}

template <class C>
bool FilterConversation<C>::come_back_by_views(const TagObservations& seen) {
  for (const TagToUse& tag : tags_.usable) {
    const auto verdict = judge(seen, tag, Patience{});
    if (!verdict) continue;
    const Pose X_BT = state().X_BV[static_cast<std::size_t>(seen.camera)] * verdict->X_VT;
    const Pose X_AB = coordinates().X_AB_of(coordinates().place_in_W(tag) * X_BT.inverse());
    if (is_return_doubtful(X_AB, seen.exposed_at)) return false;
    jump(X_AB, seen.exposed_at);
    return_.begin(tag.seen->tag_id, std::nullopt, coordinates().X_WB().p);
    return true;
  }
  return false;
}

template <class C>
void FilterConversation<C>::jump(const Pose& X_AB, Instant at) {
  follower_.jump(X_AB, at);
  candidates_.forget_all();
  contradictions_.pardon();
}

}  // namespace fiducap
