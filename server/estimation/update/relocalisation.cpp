// TagFilter: contradicting images, removal of tags and relocalisation.
#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/update/tag_filter.hpp"
#include "estimation/world/corner_measurement.hpp"

namespace fiducap {

using namespace world;         // NOLINT: the state and its operations
using namespace filter_rules;  // NOLINT: short names

namespace {
// Sightings after which a tag of the body is proven: a second at 20 Hz, from several directions.
constexpr int kSightingsToBeProven = 20;
// Consecutive images with usable tags and none accepted, before the places are decided: a jump of
// the clock is found within one second.
constexpr int kImagesToDecide = 20;
// Log odds (400 to 1) at which the other place is not kept any more.
constexpr double kSettled = -6.0;
// Time without a tag after which one may have been moved meanwhile.
constexpr double kGap_s = 0.5;
// Time without contradiction after which an unlikely other place (1 to 4) is dropped, when no
// other tag comes into view.
constexpr Duration kDoubtLasts = std::chrono::seconds(30);
constexpr double kUnlikely = -1.4;
// Position uncertainty of a body that is not published (BodyLimits).
constexpr double kPlaceUnknown_m = 0.25;
// Relocalisations without a consistent period in between, before everything is restarted.
constexpr int kMostRelocalisations = 4;
constexpr Duration kConsistent = std::chrono::seconds(2);
// IMU propagation up to which a clock jump can be found.
constexpr double kJumpBridged_s = 1.5;
// Position uncertainty above which a clock jump cannot be distinguished.
constexpr double kPlaceForJumpSearch_m = 0.1;
// Time after a contradiction for which images are collected.
constexpr double kSearchLasts_s = 1.0;
// Clock after a jump found by directions.
constexpr double kJumpSigma_s = 0.01;
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

/// Sets a clock after a jump.
void TagFilter::set_clock(int camera, double shift_s, double sigma_s) {
  if (!config_.estimate_clocks || !has_imu()) return;
  state_.clocks[static_cast<std::size_t>(camera)].shift_s = shift_s;
  open_clock(state_, sensors_, config_, camera, sigma_s);
}

/// After a clock jump: the removals since then were wrong.
void TagFilter::reset_outlier_counters() {
  memory_.forget_all();
  place_doubt_.close();
  contradictions_.reset();
  contradictions_.tags().forget_all();
  jump_search_.forget_images();
  contradicted_at_.reset();
  may_have_jumped_ = false;
}

void TagFilter::handle_outliers(const TagObservations& seen, UpdateReport& report) {
  // The start search handles contradictions of a young filter; the clock of an old one has jumped.
  if (is_start_over_ && contradictions_.contradicting_images() == kContradictionsToReopenClock) {
    const auto camera = static_cast<std::size_t>(seen.camera);
    open_clock(state_, sensors_, config_, seen.camera, sensors_.cameras[camera].time_shift_sigma_s);
    contradictions_.tags().reset_rejections();
    memory_.forget_all();
  }
  const int images = may_have_jumped_ ? 2 * kImagesToDecide : kImagesToDecide;
  if (contradictions_.images_without_fit() >= images) {
    if (!has_imu() || !is_start_over_) return restart();
    return decide_place(seen, report);
  }
  // Another camera, or other images, show tags that fit.
  if (!has_imu() || !is_start_over_ || report.tags_used > 0) return;
  if (std::ranges::any_of(tags_.usable, [&](const TagToUse& tag) {
        return contradictions_.tags().rejected(tag.seen->tag_id) >= images;
      }))
    decide_place(seen, report);
}

void TagFilter::note_clock_jump(int camera, double shift_s, double sigma_s) {
  set_clock(camera, shift_s, sigma_s);
  reset_outlier_counters();
  contradictions_.forget_all();
  lose_motion(false);
}

/// Keeps the state except for tags that joined at the wrong place.
void TagFilter::begin_relocalisation(const TagObservations& seen, UpdateReport& report) {
  if (++relocalisations_ > kMostRelocalisations) return restart();
  report.relocalised = true;
  const Instant since = place_doubt_.opened_at().value_or(seen.exposed_at);
  for (std::size_t i = state_.tags.size(); i-- > 0;)
    if (is_own(i) && state_.tags[i].first_seen > since)
      discard_tag(state_.tags[i].tag_id, seen.exposed_at, report);
  if (state_.tags.empty() && map_.tags.empty() && map_.whole == nullptr) return restart();
  const PlaceDoubt doubt = place_doubt_;  // goes on at the new place
  lose_motion(false);
  place_doubt_ = doubt;
  contradictions_.reset();
}

void TagFilter::discard_tag(int tag_id, Instant at, UpdateReport& report) {
  const int tag = state_.find(tag_id);
  if (tag >= 0) {
    // Moved tags of the map are handled by the map.
    if (is_own(static_cast<std::size_t>(tag))) contradictions_.tags().note_removal(tag_id, at);
    state_.remove_tag(static_cast<std::size_t>(tag));
  }
  contradictions_.tags().note_sighting(tag_id, true);
  memory_.forget_tag(tag_id);
  candidates_.forget(tag_id);
  anchor_.forget_tag(tag_id);
  report.name_dropped(tag_id);
}

/// Of the map, or seen often by the body, and not placed by it since its place is in doubt.
bool TagFilter::is_proven(const TagToUse& tag) const {
  const int local = state_.find(tag.seen->tag_id);
  if (local < 0) return tag.known != nullptr;
  const WorldTag& record = state_.tags[static_cast<std::size_t>(local)];
  const auto& since = place_doubt_.opened_at();
  return record.held ||
         (record.sightings >= kSightingsToBeProven && !(since && record.first_seen > *since));
}

/// Weighs the estimate against the other place that the tags of this image allow: proven tags that
/// contradict, or a single tag after a gap, which may have been moved meanwhile.
void TagFilter::weigh_places(const TagObservations& seen, UpdateReport& report) {
  if (!has_imu()) return;
  const bool is_alone = tags_.usable.size() == 1 && tags_.accepted.front();
  report.relocalised_by_one_tag = is_alone && std::sqrt(P_before_.trace()) > kPlaceUnknown_m;
  const TagHealth& health = contradictions_.tags();
  bool contradicts = false;
  for (const TagToUse& tag : tags_.usable)
    contradicts |= is_proven(tag) && health.rejected(tag.seen->tag_id) >= TagHealth::kToDoubt;
  // Uncertainty of the motion since the last fit: the common error of all tags cancels.
  const double grown_m2 = std::max(0.0, (P_before_ - P_at_fit_).trace() / 3);
  const Eigen::Matrix3d S =
      (grown_m2 + PlaceDoubt::kByOneTag_m * PlaceDoubt::kByOneTag_m) * Eigen::Matrix3d::Identity();
  const bool opens = !place_doubt_.is_open();
  if (!opens) {
    place_doubt_.move(state_.X_WB.p - p_before_);
    place_doubt_.grow(S);
  } else {
    if (!contradicts && !(is_alone && gap_before_s_ > kGap_s)) return;
    place_doubt_.open(seen.exposed_at, p_before_ - state_.X_WB.p, S);
  }
  if (contradicts) contradicted_place_at_ = seen.exposed_at;
  for (std::size_t i = 0; i < tags_.usable.size(); ++i) {
    const TagToUse& tag = tags_.usable[i];
    // A gate rejects some by chance.
    const int rejected = health.rejected(tag.seen->tag_id);
    if (rejected > 0 && rejected < TagHealth::kToDoubt) continue;
    if (!is_proven(tag) && !(opens && is_alone)) continue;
    const auto shift_W = tags_.accepted[i] ? std::nullopt : shift_by(seen, tag);
    if (tags_.accepted[i] || shift_W) place_doubt_.add(tag.seen->tag_id, shift_W);
  }
  place_doubt_.weigh();
  const Instant quiet_since = std::max(contradicted_place_at_, *place_doubt_.opened_at());
  const double least = seen.exposed_at - quiet_since > kDoubtLasts ? kUnlikely : kSettled;
  if (!contradicts && place_doubt_.log_odds() < least) place_doubt_.close();
}

void TagFilter::note_place_fit(const TagObservations& seen, UpdateReport& report) {
  P_at_fit_ = position_covariance();
  if (seen.exposed_at - contradicted_place_at_ > kConsistent) relocalisations_ = 0;
  if (std::ranges::any_of(tags_.usable,
                          [&](const TagToUse& tag) { return is_moved(tag.seen->tag_id); }))
    decide_place(seen, report);
}

Eigen::Matrix3d TagFilter::position_covariance() const {
  const Eigen::Matrix<double, 3, 6> J = plain_from_world_error(state_.X_WB.p).topRows<3>();
  return J * state_.P().topLeftCorner<6, 6>() * J.transpose();
}

/// The likelier place becomes the estimate. Tags of this image that have contradicted it often are
/// removed. The other place stays in the covariance.
void TagFilter::decide_place(const TagObservations& seen, UpdateReport& report) {
  // Where no tag fits, the IMU is wrong if a tag drifts away from the body, or contradicts again
  // after it has joined where the body put it.
  const TagHealth& health = contradictions_.tags();
  const bool is_imu_wrong =
      report.tags_used == 0 && place_doubt_.is_open() &&
      std::ranges::any_of(tags_.usable, [&](const TagToUse& tag) {
        const int tag_id = tag.seen->tag_id;
        return is_moved(tag_id) && (place_doubt_.drifts(tag_id) ||
                                    health.was_removed(tag_id, *place_doubt_.opened_at()));
      });
  if (place_doubt_.contradicting_tag() >= 0 && (place_doubt_.log_odds() > 0 || is_imu_wrong)) {
    place_doubt_.change_place();
    for (const TagToUse& tag : tags_.usable)
      if (place_doubt_.contradicts(tag.seen->tag_id))
        discard_tag(tag.seen->tag_id, seen.exposed_at, report);
    return begin_relocalisation(seen, report);
  }
  for (const TagToUse& tag : tags_.usable)
    if (is_moved(tag.seen->tag_id)) discard_tag(tag.seen->tag_id, seen.exposed_at, report);
  if (report.tags_used == 0) contradictions_.reset();
}

bool TagFilter::is_moved(int tag_id) const {
  return contradictions_.tags().rejected(tag_id) >= TagHealth::kToDecide;
}

bool TagFilter::relocalise(const TagObservations& seen) {
  if (!pose_finder_.knows_attitude()) return false;
  const auto found = pose_finder_.find(state_, seen.exposed_at,
                                       image_update_.sighted(state_, seen.camera, tags_.usable),
                                       image_update_.noise(seen.camera).unexplained_px());
  ++relocalisation_attempts_;
  const bool is_forced = has_imu() && relocalisation_attempts_ >= kForceWithImu;
  if (found && (found->evidence >= config_.branch_evidence || is_forced)) {
    // Outliers would pass the gate of a body whose covariance is wide.
    std::erase_if(tags_.usable, [&](const TagToUse& tag) {
      const auto one = image_update_.sighted(state_, seen.camera, std::span(&tag, 1));
      return !fits(one.front(), found->X_AB, image_update_.noise(seen.camera).unexplained_px());
    });
    jump(found->X_AB, seen.exposed_at);
    return true;
  }
  return relocalise_by_views(seen);
}

bool TagFilter::relocalise_by_views(const TagObservations& seen) {
  for (const TagToUse& tag : tags_.usable) {
    const auto verdict = judge(seen, tag, ViewLimits{});
    if (!verdict) continue;
    const Pose X_BT = state_.X_BV[static_cast<std::size_t>(seen.camera)] * verdict->X_VT;
    jump(place_of(state_, tag) * X_BT.inverse(), seen.exposed_at);
    return true;
  }
  return false;
}

}  // namespace fiducap
