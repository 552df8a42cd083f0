#pragma once

#include <algorithm>

#include "base/expected.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/update/tag_filter.hpp"
#include "estimation/update/workspace_anchor.hpp"

namespace fiducap {

namespace filter_rules {
// Cost of a sighting that is neither used nor rejected, slightly above that of a good fit.
inline constexpr double kNumbersOfTag = 8.0;
inline constexpr double kUnexplained = 10.0;
}  // namespace filter_rules

using namespace filter_rules;  // NOLINT: included by sources alone

template <class C>
TagFilter<C>::TagFilter(BodySensors sensors, const WorkspaceGauge& gauge,
                        const EstimatorConfig& config, ClockHypothesis clocks)
    : follower_(std::move(sensors), config),
      anchor_(gauge, follower_.has_imu()),
      candidates_(config),
      restart_clocks_(std::move(clocks)),
      gate_(chi_square_quantile(8, config.gate_probability)) {
  restart();
}

template <class C>
void TagFilter<C>::restart() {
  ++generation_;
  clocks_ = restart_clocks_;
  is_start_over_ = false;
  follower_.reset(clocks_);
  anchor_.forget();
  exact_tag_W_.reset();
  contradictions_.forget_all();
  candidates_.forget_all();
  unstable_tags_.forget_all();
  unconfirmed_removals_.clear();
  ambiguous_offset_W_.reset();
  single_tag_.forget();
  relocalisations_ = 0;
}

template <class C>
void TagFilter<C>::set_tag_priors(std::vector<KnownTag> priors) {
  priors_.clear();
  for (const KnownTag& prior : priors) priors_[prior.tag_id] = prior;
}

template <class C>
void TagFilter<C>::release_tag(int tag_id) {
  if constexpr (!C::kRemembersImages) return;  // RCARS keeps its tags
  const int tag = state().find(tag_id);
  if (tag < 0 || anchor_.defined_by() == tag_id || !is_following() || !anchor_.is_anchored())
    return;
  coordinates().state().remove_tag(static_cast<std::size_t>(tag));
  coordinates().forget_past();  // its states contain the tag
}

template <class C>
void TagFilter<C>::end_start() {
  is_start_over_ = true;
  if (clocks_.spread > 0) return;
  const auto& cameras = follower_.sensors().cameras;
  for (std::size_t k = 0; k < cameras.size(); ++k)
    coordinates().open_clock(static_cast<int>(k), cameras[k].time_shift_sigma_s);
  contradictions_.reset_tag_scores();
  coordinates().forget_past();  // its states have held clocks
  clocks_.spread = 1.0;
}

template <class C>
bool TagFilter<C>::running() const {
  return is_following() && (anchor_.is_anchored() || !state().tags.empty());
}

template <class C>
void TagFilter<C>::propagate(const ImuSample& imu) {
  if (has_imu() && !follower_.add(imu)) candidates_.forget_all();
}

template <class C>
UpdateReport TagFilter<C>::update(const TagObservations& seen, const MapKnowledge& map) {
  map_ = map;
  const int generation = generation_;
  UpdateReport report = process(seen, map.tags);
  report.generation = generation_;
  report.running = running();
  map_ = {};
  if (generation_ != generation) report.gauge_shift.reset();  // no earlier poses
  return report;
}

template <class C>
void TagFilter<C>::sort(const TagObservations& seen, std::span<const KnownTag> known) {
  coordinates().hold_map_tags(seen, known, map_.whole, anchor_.is_anchored());
  tags_.sort(seen, known, state(), anchor_.is_anchored());
  const auto is_excluded = [&](const TagToUse& tag) {
    return unstable_tags_.is_excluded(tag.seen->tag_id, seen.exposed_at);
  };
  std::erase_if(tags_.usable, is_excluded);
  std::erase_if(tags_.fresh, is_excluded);
}

template <class C>
UpdateReport TagFilter<C>::process(const TagObservations& seen, std::span<const KnownTag> known) {
  UpdateReport report;
  report.exposed_at = seen.exposed_at;
  report.tags_seen = static_cast<int>(seen.tags.size());
  if (is_following() && seen.exposed_at < state().time)
    return report;  // late; counted by the merger

  predict(seen, known, report);
  const int iterations = move_to(seen);
  bool is_at_image = iterations > 0;
  if (is_at_image && !tags_.usable.empty()) correct(seen, iterations, report);
  if (is_in_mode(FilterMode::kLost)) report.tags_pending = static_cast<int>(tags_.usable.size());
  if (coordinates().is_aimed() && report.tags_used == 0) {
    // The motion by the corners was wrong: ignores this image.
    coordinates().take_back();
    is_at_image = false;
  }
  if (is_at_image) coordinates().doubt(seen, report);
  if constexpr (C::kRemembersImages) {
    if (is_at_image) {
      coordinates().memory().add(seen, known);
      coordinates().correct_by_points(seen, coordinates().memory().newest(), report);
      if (report.landmarks_used >= kLandmarksToStay) contradictions_.note_fit(seen.exposed_at);
    }
  }
  if (is_at_image || is_in_mode(FilterMode::kStarting) ||
      (is_in_mode(FilterMode::kLost) && tags_.usable.empty()))
    initialise_new_tags(seen, report);
  look_for_jump(seen, report);
  handle_outliers(seen, report);
  if (is_following())
    shift_axes(anchor_.by_definition(coordinates(), map_.may_define_workspace), report);
  if (ambiguous_offset_W_)
    report.ambiguous_place =
        UpdateReport::AmbiguousPlace{ambiguous_tag_, ambiguous_offset_W_->norm()};
  if (!has_imu() && report.tags_used > 0) note_exact_tags();
  return report;
}

template <class C>
void TagFilter<C>::predict(const TagObservations& seen, std::span<const KnownTag> known,
                           UpdateReport& report) {
  coordinates().look_at(seen);
  if (is_following()) {
    if (const auto shift = anchor_.by_own_tags(coordinates(), known, map_.whole == nullptr)) {
      coordinates().forget_past();  // not anchored
      shift_axes(shift, report);
    }
    if (map_.whole != nullptr && anchor_.is_anchored()) follow_map(report);
  }
  sort(seen, known);
  gap_before_s_ = contradictions_.seconds_without_fit(seen.exposed_at);
  const double longest_s = has_imu() ? kLostAfterWithImu_s : kLostAfterWithoutImu_s;
  if (gap_before_s_ > longest_s) lose_motion(false);
  coordinates().forget_aim();
  if (C::kStartsBeforeTags && is_in_mode(FilterMode::kStarting) && has_imu() &&
      follower_.knows_attitude() && !tags_.fresh.empty()) {
    follower_.start(seen.exposed_at);
    contradictions_.note_fit(seen.exposed_at);
  }
}

/// Once the map is available it defines the workspace.
template <class C>
void TagFilter<C>::follow_map(UpdateReport& report) {
  // Smaller shifts do not resemble a clock jump.
  constexpr double kNoticeable_m = 0.005;
  const auto moved = coordinates().follow_map(*map_.whole, map_.body_id);
  if (!moved) return;
  anchor_.give_to_map();
  report.map_shift = moved;
  const Eigen::Vector3d p_WB = coordinates().X_WB().p;
  if ((p_WB - moved->inverse() * p_WB).norm() > kNoticeable_m) follower_.jump_search().forget_all();
}

template <class C>
int TagFilter<C>::move_to(const TagObservations& seen) {
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
  if (is_in_mode(FilterMode::kLost)) {
    is_at_image = !tags_.usable.empty() && relocalise(seen);
    iterations = kFirstIterations;
  }
  return is_at_image ? iterations : 0;
}

template <class C>
UpdateReport TagFilter<C>::correct(const TagObservations& seen, int iterations) {
  const UpdateReport done =
      coordinates().correct(seen, tags_.usable, gate_, iterations, tags_.accepted);
  note_sightings(coordinates().state(), tags_.usable, tags_.accepted, seen.exposed_at);
  return done;
}

template <class C>
void TagFilter<C>::correct(const TagObservations& seen, int iterations, UpdateReport& report) {
  place_before_ = coordinates().place();
  const UpdateReport done = correct(seen, iterations);
  report.take_correction(done);
  report.tags_measured = done.tags_measured;
  report.corner_fits = done.corner_fits;
  for (std::size_t i = 0; i < tags_.usable.size(); ++i) {
    // Own tags do not confirm the map.
    const int local = tags_.usable[i].local;
    const bool is_own = local >= 0 && coordinates().is_own(static_cast<std::size_t>(local));
    if (tags_.accepted[i] && !is_own) report.name_fitting(tags_.usable[i].seen->tag_id);
  }
  const auto removed =
      contradictions_.count(seen.camera, seen.exposed_at, tags_.usable, tags_.accepted);
  for (const int tag_id : std::vector<int>(removed.begin(), removed.end()))
    discard_tag(tag_id, seen.exposed_at, report);
  confirm_removals();
  update_ambiguity(seen);
  check_single_tag_relocalisation(seen, report);
}

template <class C>
void TagFilter<C>::shift_axes(const std::optional<Pose>& X_new_old, UpdateReport& report) {
  if (!X_new_old) return;
  report.gauge_shift = *X_new_old * report.gauge_shift.value_or(Pose{});
  coordinates().moved_axes(*X_new_old);
  if (ambiguous_offset_W_) ambiguous_offset_W_ = X_new_old->q * *ambiguous_offset_W_;
  follower_.jump_search().forget_all();
  if (!has_imu()) candidates_.forget_all();  // views in the old axes
}

template <class C>
BodyEstimate TagFilter<C>::estimate() const {
  FIDUCAP_ASSERT(running());
  BodyEstimate out = follower_.estimate();
  out.anchored = anchor_.is_anchored();
  if (ambiguous_offset_W_)
    out.covariance.topLeftCorner<3, 3>() += *ambiguous_offset_W_ * ambiguous_offset_W_->transpose();
  if (!has_imu() && follower_.config().doubt_configuration) add_bend_of_prints(out);
  return out;
}

/// Remembers the nearest exact map tag: these are not in the state.
template <class C>
void TagFilter<C>::note_exact_tags() {
  bool is_first = true;
  const Eigen::Vector3d p_WB = coordinates().X_WB().p;
  for (const TagToUse& tag : tags_.usable) {
    if (tag.local >= 0 || !tag.known->is_exact()) continue;
    const Eigen::Vector3d& p_WT = tag.known->X_WT.p;
    if (is_first || (p_WT - p_WB).norm() < (*exact_tag_W_ - p_WB).norm()) exact_tag_W_ = p_WT;
    is_first = false;
  }
}

/// Adds the covariance of bent paper relative to the nearest tag that defines W: of the map, the
/// reference tag or a surveyed tag. The map's covariance contains that of its own tags.
template <class C>
void TagFilter<C>::add_bend_of_prints(BodyEstimate& body) const {
  const Eigen::Vector3d p_WB = body.X_WB.p;
  std::optional<Eigen::Vector3d> nearest = exact_tag_W_;
  for (std::size_t i = 0; i < state().tags.size() && body.anchored; ++i) {
    const int tag_id = state().tags[i].tag_id;
    if (coordinates().is_own(i) && anchor_.defined_by() != tag_id && !priors_.contains(tag_id))
      continue;
    const Eigen::Vector3d p_WT = tag_in_workspace(state(), i).X_WT.p;
    if (!nearest || (p_WB - p_WT).norm() < (p_WB - *nearest).norm()) nearest = p_WT;
  }
  if (nearest) body.covariance.topLeftCorner<6, 6>() += bend_of_print(p_WB - *nearest);
}

template <class C>
void TagFilter<C>::tag_beliefs(std::vector<TagBelief>& out) const {
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
void TagFilter<C>::mismatches(std::vector<FoundMismatch>& out) const {
  using Kind = FoundMismatch::Kind;
  out.clear();
  coordinates().list_mismatches(out);
  const ImuBuffer::RangesMet& met = follower_.ranges_met();
  if (met.gyro_rad_s > 0) out.push_back({.kind = Kind::kGyroRange, .value = met.gyro_rad_s});
  if (met.accel_m_s2 > 0) out.push_back({.kind = Kind::kAccelRange, .value = met.accel_m_s2});
}

template <class C>
std::vector<ExtrinsicsEstimate> TagFilter<C>::extrinsics() const {
  std::vector<ExtrinsicsEstimate> out;
  for (int c = 0; c < state().cameras(); ++c) {
    out.push_back({state().X_BV[static_cast<std::size_t>(c)],
                   coordinates().extrinsics_covariance(c), clock(c), coordinates().lens(c)});
  }
  return out;
}

template <class C>
Explanation TagFilter<C>::explain(const TagObservations& seen, const UpdateReport& report) const {
  const int unexplained = report.tags_seen - report.tags_used - report.tags_rejected;
  Explanation out{report.nis + gate_ * report.tags_rejected + kUnexplained * unexplained,
                  kNumbersOfTag * report.tags_seen};
  // Normalisation term of the likelihood.
  const CornerNoise& noise = coordinates().noise(seen.camera);
  for (const TagObservation& tag : seen.tags)
    out.cost += 2.0 * kNumbersOfTag * std::log(noise.growth(tag));
  return out;
}

}  // namespace fiducap
