#pragma once

#include <algorithm>

#include "base/assert.hpp"
#include "estimation/conversation/filter_conversation.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/print_bend.hpp"

namespace fiducap {

namespace filter_rules {
// A sighting that nothing explains yet costs a little more than one that is explained well.
inline constexpr double kNumbersOfTag = 8.0;
inline constexpr double kUnexplained = 10.0;
}  // namespace filter_rules

template <class C>
FilterConversation<C>::FilterConversation(BodySensors sensors, const WorkspaceGauge& gauge,
                                          const EstimatorConfig& config, ClockHypothesis clocks)
    : follower_(std::move(sensors), config),
      anchor_(gauge, follower_.has_imu()),
      candidates_(config),
      restart_clocks_(std::move(clocks)),
      gate_(chi_square_quantile(8, config.gate_probability)) {
  restart();
}

template <class C>
void FilterConversation<C>::restart() {
  ++generation_;
  clocks_ = restart_clocks_;
  is_start_over_ = false;
  follower_.reset(clocks_);
  anchor_.forget();
  exact_tag_W_.reset();
  contradictions_.forget_all();
  candidates_.forget_all();
  restless_.forget_all();
  unwitnessed_.clear();
  elsewhere_W_.reset();
  return_.forget();
  relocalisations_ = 0;
}

template <class C>
void FilterConversation<C>::set_tag_priors(std::vector<KnownTag> priors) {
  priors_.clear();
  for (const KnownTag& prior : priors) priors_[prior.tag_id] = prior;
}

template <class C>
void FilterConversation<C>::release_tag(int tag_id) {
  if constexpr (!C::kRemembersImages) return;  // the paper keeps its tags
  const int tag = state().find(tag_id);
  if (tag < 0 || anchor_.defined_by() == tag_id || !is_following() || !anchor_.is_anchored())
    return;
  coordinates().state().remove_tag(static_cast<std::size_t>(tag));
  coordinates().forget_past();  // its states still hold the tag
}

template <class C>
void FilterConversation<C>::end_start() {
  is_start_over_ = true;
  if (clocks_.spread > 0) return;
  const auto& cameras = follower_.sensors().cameras;
  for (std::size_t k = 0; k < cameras.size(); ++k)
    coordinates().open_clock(static_cast<int>(k), cameras[k].time_shift_sigma_s);
  contradictions_.pardon_tags();
  coordinates().forget_past();  // its states still believe in the clocks
  clocks_.spread = 1.0;
}

template <class C>
bool FilterConversation<C>::running() const {
  return is_following() && (anchor_.is_anchored() || !state().tags.empty());
}

template <class C>
void FilterConversation<C>::propagate(const ImuSample& imu) {
  if (has_imu() && !follower_.add(imu)) candidates_.forget_all();
}

template <class C>
UpdateReport FilterConversation<C>::update(const TagObservations& seen, const MapKnowledge& map) {
  map_ = map;
  const int generation = generation_;
  UpdateReport report = process(seen, map.tags);
  report.generation = generation_;
  report.running = running();
  map_ = {};
  if (generation_ != generation) report.gauge_shift.reset();  // nothing was given out since
  return report;
}

template <class C>
void FilterConversation<C>::sort(const TagObservations& seen, std::span<const KnownTag> known) {
  coordinates().hold_map_tags(seen, known, map_.whole, anchor_.is_anchored());
  tags_.sort(seen, known, state(), anchor_.is_anchored());
  const auto is_barred = [&](const TagToUse& tag) {
    return restless_.is_barred(tag.seen->tag_id, seen.exposed_at);
  };
  std::erase_if(tags_.usable, is_barred);
  std::erase_if(tags_.fresh, is_barred);
}

template <class C>
UpdateReport FilterConversation<C>::process(const TagObservations& seen,
                                            std::span<const KnownTag> known) {
  UpdateReport report;
  report.exposed_at = seen.exposed_at;
  report.tags_seen = static_cast<int>(seen.tags.size());
  if (is_following() && seen.exposed_at < state().time)
    return report;  // too late; the merger counts these

  meet(seen, known, report);
  const int iterations = move_to(seen);
  bool is_at_image = iterations > 0;
  if (is_at_image && !tags_.usable.empty()) correct(seen, iterations, report);
  if (is_in_mode(FilterMode::kAdrift)) report.tags_pending = static_cast<int>(tags_.usable.size());
  if (coordinates().is_aimed() && report.tags_used == 0) {
    // The motion that the corners showed was no motion: forget this image.
    coordinates().take_back();
    is_at_image = false;
  }
  if (is_at_image) coordinates().doubt(seen, report);
  if constexpr (C::kRemembersImages) {
    if (is_at_image) {
      coordinates().memory().add(seen, known);
      coordinates().correct_by_points(seen, coordinates().memory().newest(), report);
      if (report.landmarks_used >= filter_rules::kLandmarksToStay)
        contradictions_.note_fit(seen.exposed_at);
    }
  }
  if (is_at_image || is_in_mode(FilterMode::kStarting) ||
      (is_in_mode(FilterMode::kAdrift) && tags_.usable.empty()))
    meet_fresh_tags(seen, report);
  look_for_jump(seen, report);
  answer_contradictions(seen, report);
  if (is_following())
    shift_axes(anchor_.by_definition(coordinates(), map_.may_define_workspace), report);
  if (elsewhere_W_)
    report.elsewhere = UpdateReport::Elsewhere{elsewhere_tag_, elsewhere_W_->norm()};
  if (!has_imu() && report.tags_used > 0) note_exact_tags();
  return report;
}

template <class C>
void FilterConversation<C>::meet(const TagObservations& seen, std::span<const KnownTag> known,
                                 UpdateReport& report) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  coordinates().look_at(seen);
  if (is_following()) {
    if (const auto shift = anchor_.by_own_tags(coordinates(), known, map_.whole == nullptr)) {
      coordinates().forget_past();  // it does not know where the room is
      shift_axes(shift, report);
    }
    if (map_.whole != nullptr && anchor_.is_anchored()) follow_map(report);
  }
  sort(seen, known);
  gap_before_s_ = contradictions_.seconds_without_fit(seen.exposed_at);
  const double longest_s = has_imu() ? kAdriftWithImu_s : kAdriftWithoutImu_s;
  if (contradictions_.seconds_without_fit(seen.exposed_at) > longest_s) lose_motion(false);
  coordinates().forget_aim();
  if (C::kStartsBeforeTags && is_in_mode(FilterMode::kStarting) && has_imu() &&
      follower_.knows_attitude() && !tags_.fresh.empty()) {
    follower_.start(seen.exposed_at);
    contradictions_.note_fit(seen.exposed_at);
  }
}

/// From its first word on the map says where the workspace is.
template <class C>
void FilterConversation<C>::follow_map(UpdateReport& report) {
  // Less does not look like a clock that jumped.
  constexpr double kNoticeable_m = 0.005;
  const auto moved = coordinates().follow_map(*map_.whole, map_.body_id);
  if (!moved) return;
  anchor_.give_to_map();
  report.map_shift = moved;
  const Eigen::Vector3d p_WB = coordinates().X_WB().p;
  if ((p_WB - moved->inverse() * p_WB).norm() > kNoticeable_m) follower_.jump_search().forget_all();
}

template <class C>
int FilterConversation<C>::move_to(const TagObservations& seen) {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  bool is_at_image = false;
  int iterations = 1;
  if (is_following()) {
    is_at_image = follower_.move_to(seen, tags_.usable);
    if (coordinates().is_aimed()) iterations = kCornerStepIterations;
    if (has_imu() && gap_before_s_ > kCoasted_s) iterations = kFirstIterations;
    if (is_at_image && has_imu() && coordinates().is_attitude_unknown()) {
      lose_motion(true);
      is_at_image = false;
    }
  }
  if (is_in_mode(FilterMode::kAdrift)) {
    is_at_image = !tags_.usable.empty() && come_back(seen);
    iterations = kFirstIterations;
  }
  return is_at_image ? iterations : 0;
}

template <class C>
UpdateReport FilterConversation<C>::correct(const TagObservations& seen, int iterations) {
  const UpdateReport done =
      coordinates().correct(seen, tags_.usable, gate_, iterations, tags_.accepted);
  note_sightings(coordinates().state(), tags_.usable, tags_.accepted, seen.exposed_at);
  return done;
}

template <class C>
void FilterConversation<C>::correct(const TagObservations& seen, int iterations,
                                    UpdateReport& report) {
  place_before_ = coordinates().place();
  const UpdateReport done = correct(seen, iterations);
  report.tags_used = done.tags_used;
  report.tags_rejected = done.tags_rejected;
  report.nis = done.nis;
  report.nis_dof = done.nis_dof;
  report.reprojection_px = done.reprojection_px;
  report.tags_measured = done.tags_measured;
  report.corner_fits = done.corner_fits;
  for (std::size_t i = 0; i < tags_.usable.size(); ++i) {
    // Tags of the body's own only say that it agrees with itself.
    const int local = tags_.usable[i].local;
    const bool is_own = local >= 0 && coordinates().is_own(static_cast<std::size_t>(local));
    if (tags_.accepted[i] && !is_own) report.name_fitting(tags_.usable[i].seen->tag_id);
  }
  const auto given_up =
      contradictions_.count(seen.camera, seen.exposed_at, tags_.usable, tags_.accepted);
  for (const int tag_id : std::vector<int>(given_up.begin(), given_up.end()))
    give_up(tag_id, seen.exposed_at, report);
  note_witnesses();
  note_elsewhere(seen);
  watch_return(seen, report);
}

template <class C>
ClockEstimate FilterConversation<C>::clock(int camera) const {
  return coordinates().clock(camera);
}

template <class C>
LearnedSensors FilterConversation<C>::learned(int camera) const {
  return coordinates().learned(camera);
}

template <class C>
void FilterConversation<C>::shift_axes(const std::optional<Pose>& X_new_old, UpdateReport& report) {
  if (!X_new_old) return;
  report.gauge_shift = *X_new_old * report.gauge_shift.value_or(Pose{});
  coordinates().moved_axes(*X_new_old);
  if (elsewhere_W_) elsewhere_W_ = X_new_old->q * *elsewhere_W_;
  follower_.jump_search().forget_all();
  if (!has_imu()) candidates_.forget_all();  // their views were in the old axes
}

template <class C>
BodyEstimate FilterConversation<C>::estimate() const {
  FIDUCAP_ASSERT(running());
  BodyEstimate out = follower_.estimate();
  out.anchored = anchor_.is_anchored();
  if (elsewhere_W_)
    out.covariance.topLeftCorner<3, 3>() += *elsewhere_W_ * elsewhere_W_->transpose();
  if (!has_imu() && follower_.config().doubt_configuration) add_bend_of_prints(out);
  return out;
}

/// Exact tags of the map are not in the state: the nearest one of the last image that used one.
template <class C>
void FilterConversation<C>::note_exact_tags() {
  bool is_first = true;
  const Eigen::Vector3d p_WB = coordinates().X_WB().p;
  for (const TagToUse& tag : tags_.usable) {
    if (tag.local >= 0 || !tag.known->is_exact()) continue;
    const Eigen::Vector3d& p_WT = tag.known->X_WT.p;
    if (is_first || (p_WT - p_WB).norm() < (*exact_tag_W_ - p_WB).norm()) exact_tag_W_ = p_WT;
    is_first = false;
  }
}

/// About the nearest print that says where W is: a tag of the map, the one that W was defined by,
/// or one whose place was told. That the map was learned by bent prints, too, is for its covariance
/// to say.
template <class C>
void FilterConversation<C>::add_bend_of_prints(BodyEstimate& body) const {
  const Eigen::Vector3d p_WB = body.X_WB.p;
  std::optional<Eigen::Vector3d> nearest = exact_tag_W_;
  for (std::size_t i = 0; i < state().tags.size() && body.anchored; ++i) {
    const int tag_id = state().tags[i].tag_id;
    const bool says_where =
        !coordinates().is_own(i) || anchor_.defined_by() == tag_id || priors_.contains(tag_id);
    if (!says_where) continue;
    const Eigen::Vector3d p_WT = tag_in_workspace(state(), i).X_WT.p;
    if (!nearest || (p_WB - p_WT).norm() < (p_WB - *nearest).norm()) nearest = p_WT;
  }
  if (nearest) body.covariance.topLeftCorner<6, 6>() += bend_of_print(p_WB - *nearest);
}

template <class C>
void FilterConversation<C>::tag_beliefs(std::vector<TagBelief>& out) const {
  out.clear();
  const int component = anchor_.is_anchored() ? TagBelief::kWorkspace : TagBelief::kOwnAxes;
  for (std::size_t i = 0; i < state().tags.size(); ++i) {
    const auto& tag = state().tags[i];
    if (!coordinates().is_own(i)) continue;
    out.push_back(
        {tag_in_workspace(state(), i), tag.sightings, tag.first_seen, tag.last_seen, component});
  }
}

template <class C>
void FilterConversation<C>::mismatches(std::vector<FoundMismatch>& out) const {
  using Kind = FoundMismatch::Kind;
  out.clear();
  coordinates().list_mismatches(out);
  const ImuBuffer::RangesMet& met = follower_.ranges_met();
  if (met.gyro_rad_s > 0) out.push_back({.kind = Kind::kGyroRange, .value = met.gyro_rad_s});
  if (met.accel_m_s2 > 0) out.push_back({.kind = Kind::kAccelRange, .value = met.accel_m_s2});
}

template <class C>
std::vector<ExtrinsicsEstimate> FilterConversation<C>::extrinsics() const {
  std::vector<ExtrinsicsEstimate> out;
  for (int c = 0; c < state().cameras(); ++c) {
    out.push_back({state().X_BV[static_cast<std::size_t>(c)],
                   coordinates().extrinsics_covariance(c), clock(c), coordinates().lens(c)});
  }
  return out;
}

template <class C>
Explanation FilterConversation<C>::explain(const TagObservations& seen,
                                           const UpdateReport& report) const {
  using namespace filter_rules;  // NOLINT: short names for what filters go by
  const int unexplained = report.tags_seen - report.tags_used - report.tags_rejected;
  Explanation out{report.nis + gate_ * report.tags_rejected + kUnexplained * unexplained,
                  kNumbersOfTag * report.tags_seen};
  // Corners that are called noisy have small distances: the likelihood's other term.
  const CornerNoise& noise = coordinates().noise(seen.camera);
  for (const TagObservation& tag : seen.tags)
    out.cost += 2.0 * kNumbersOfTag * std::log(noise.growth(tag));
  return out;
}

}  // namespace fiducap
