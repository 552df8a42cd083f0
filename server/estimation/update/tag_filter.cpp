#include "estimation/update/tag_filter.hpp"

#include <algorithm>
#include <cmath>

#include "base/expected.hpp"
#include "estimation/filter/chi_square.hpp"
#include "estimation/filter/filter_rules.hpp"

namespace fiducap {

using namespace world;         // NOLINT: the state and its operations
using namespace filter_rules;  // NOLINT: short names

namespace {
// Cost of a sighting that is neither used nor rejected, slightly above that of a good fit.
constexpr double kNumbersOfTag = 8.0;
constexpr double kUnusedCost = 10.0;
// The body is lost after this time without a used tag: IMU drift, or an uninformative motion model.
constexpr double kLostAfterWithImu_s = 10.0;
constexpr double kLostAfterWithoutImu_s = 1.0;
// An update far from the linearisation point, or after this time without an accepted tag, is
// iterated: drift makes one linearisation inaccurate by hundredths of a pixel.
constexpr double kCoasted_s = 0.5;
constexpr int kCornerStepIterations = 2;
// Fewer image points than this cannot confirm each other (edges, partly visible tags).
constexpr std::size_t kFewestPoints = 10;
constexpr double kUnknownTurn_rad = 0.4;  // of the attitude, 1-sigma
// Beyond, the tags of the map are held: each image changes all of these 720 x 720 covariances.
constexpr std::size_t kMostOwnTags = 120;
// Probability of the fit of three corners, by which a tag is used without the fourth: lower than
// the gate's, as a tag at another place may fit three corners by chance.
constexpr double kThreeCornersFit = 0.9;

bool is_attitude_unknown(const FilterState& state) {
  return state.P().diagonal().segment<3>(layout::kAttitude).maxCoeff() >
         kUnknownTurn_rad * kUnknownTurn_rad;
}
}  // namespace

void ImageTags::sort(const TagObservations& seen, std::span<const KnownTag> known,
                     const FilterState& state, bool is_anchored) {
  usable.clear();
  fresh.clear();
  for (const TagObservation& tag : seen.tags) {
    const auto found = std::ranges::find(known, tag.tag_id, &KnownTag::tag_id);
    const TagToUse use{&tag, state.find(tag.tag_id), found == known.end() ? nullptr : &*found};
    const bool is_usable = use.local >= 0 || (use.known != nullptr && is_anchored);
    (is_usable ? usable : fresh).push_back(use);
  }
}

void ImageTags::find_again(const FilterState& state) {
  for (std::size_t i = usable.size(); i-- > 0;) {
    usable[i].local = state.find(usable[i].seen->tag_id);
    if (usable[i].local >= 0 || usable[i].known != nullptr) continue;
    usable.erase(usable.begin() + static_cast<std::ptrdiff_t>(i));
    accepted.erase(accepted.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

TagFilter::TagFilter(BodySensors sensors, const WorkspaceGauge& gauge,
                     const EstimatorConfig& config, ClockHypothesis clocks)
    : sensors_(std::move(sensors)),
      config_(config),
      propagator_(sensors_, config_),
      image_update_(sensors_, config_),
      pose_finder_(config_, has_imu()),
      anchor_(gauge, has_imu()),
      candidates_(config),
      restart_clocks_(std::move(clocks)),
      gate_{chi_square_quantile(8, config.gate_probability),
            chi_square_quantile(6, kThreeCornersFit)} {
  FIDUCAP_ASSERT(!sensors_.cameras.empty());
  if (config_.landmarks && has_imu()) window_.emplace(sensors_.cameras.size(), LandmarkRules{});
  restart();
}

const CameraModel& TagFilter::model_of(int camera) const {
  FIDUCAP_ASSERT(camera >= 0 && camera < static_cast<int>(sensors_.cameras.size()));
  return sensors_.cameras[static_cast<std::size_t>(camera)].model;
}

void TagFilter::restart() {
  ++generation_;
  clocks_ = restart_clocks_;
  is_start_over_ = false;
  jump_search_.forget_all();
  reset(state_, sensors_, config_, clocks_, window_ ? CloneWindow::kClones : 0);
  image_update_.restart(state_);
  propagator_.restart();
  memory_.forget_all();
  held_tags_ = {};
  mode_ = FilterMode::kStarting;
  pose_finder_.forget_instant();
  pose_finder_.restart(false);
  anchor_.forget();
  exact_tag_W_.reset();
  contradictions_.forget_all();
  candidates_.forget_all();
  place_doubt_.close();
  relocalisations_ = 0;
}

void TagFilter::set_tag_priors(std::vector<KnownTag> priors) {
  priors_.clear();
  for (const KnownTag& prior : priors) priors_[prior.tag_id] = prior;
}

void TagFilter::end_start() {
  is_start_over_ = true;
  if (clocks_.spread > 0) return;
  const auto& cameras = sensors_.cameras;
  for (std::size_t k = 0; k < cameras.size(); ++k)
    open_clock(state_, sensors_, config_, static_cast<int>(k), cameras[k].time_shift_sigma_s);
  contradictions_.tags().reset_rejections();
  memory_.forget_all();  // its states have held clocks
  clocks_.spread = 1.0;
}

bool TagFilter::running() const {
  return is_following() && (anchor_.is_anchored() || !state_.tags.empty());
}

void TagFilter::propagate(const ImuSample& imu) {
  if (has_imu() && !add_reading(imu)) candidates_.forget_all();
}

UpdateReport TagFilter::update(const TagObservations& seen, const MapKnowledge& map) {
  map_ = map;
  const bool keeps_tags = has_made(map);
  if (keeps_tags) map_ = {.may_define_workspace = false};
  const int generation = generation_;
  UpdateReport report = process(seen, map_.tags);
  for (const KnownTag& tag : map.tags) {
    const int own = keeps_tags ? state_.find(tag.tag_id) : -1;
    if (own >= 0 && state_.tags[static_cast<std::size_t>(own)].last_seen == seen.exposed_at)
      report.name_fitting(tag.tag_id);
  }
  report.generation = generation_;
  report.running = running();
  map_ = {};
  if (generation_ != generation) report.gauge_shift.reset();  // no earlier poses
  return report;
}

/// The map is an estimate from a part of this filter's own data: its tags stay in the state, and
/// are estimated with the newest images and with all correlations.
bool TagFilter::has_made(const MapKnowledge& map) const {
  return map.whole != nullptr && map.whole->made_by == map.body_id && anchor_.defined_by() &&
         state_.tags.size() <= kMostOwnTags;
}

void TagFilter::sort(const TagObservations& seen, std::span<const KnownTag> known) {
  held_tags_.follow(state_, seen, known, map_.whole, anchor_.is_anchored());
  tags_.sort(seen, known, state_, anchor_.is_anchored());
  const auto is_excluded = [&](const TagToUse& tag) {
    return contradictions_.tags().is_excluded(tag.seen->tag_id, seen.exposed_at);
  };
  std::erase_if(tags_.usable, is_excluded);
  std::erase_if(tags_.fresh, is_excluded);
}

UpdateReport TagFilter::process(const TagObservations& seen, std::span<const KnownTag> known) {
  UpdateReport report;
  report.exposed_at = seen.exposed_at;
  report.tags_seen = static_cast<int>(seen.tags.size());
  if (is_following() && seen.exposed_at < state_.time)
    return report;  // late; counted by the merger

  predict(seen, known, report);
  const int iterations = move_to(seen);
  bool is_at_image = iterations > 0;
  if (is_at_image && !tags_.usable.empty()) correct(seen, iterations, report);
  if (mode_ == FilterMode::kLost) report.tags_pending = static_cast<int>(tags_.usable.size());
  if (propagator_.linearisation() != nullptr && report.tags_used == 0) {
    // The motion by the corners was wrong: ignores this image.
    propagator_.take_back(state_);
    is_at_image = false;
  }
  if (is_at_image) {
    image_update_.test(state_, seen, report);
    memory_.add(seen, known);
    correct_by_points(seen, memory_.newest(), report);
    if (report.landmarks_used >= kLandmarksToStay) contradictions_.note_fit(seen.exposed_at);
  }
  if (is_at_image || mode_ == FilterMode::kStarting ||
      (mode_ == FilterMode::kLost && tags_.usable.empty()))
    initialise_new_tags(seen, report);
  look_for_jump(seen, report);
  handle_outliers(seen, report);
  if (is_following()) shift_axes(anchor_.by_definition(state_, map_.may_define_workspace), report);
  if (place_doubt_.is_open() && place_doubt_.contradicting_tag() >= 0)
    report.ambiguous_place = UpdateReport::AmbiguousPlace{place_doubt_.contradicting_tag(),
                                                          place_doubt_.other_place_W().norm()};
  if (!has_imu() && report.tags_used > 0) note_exact_tags();
  return report;
}

void TagFilter::predict(const TagObservations& seen, std::span<const KnownTag> known,
                        UpdateReport& report) {
  image_update_.look_at(state_, seen);
  if (is_following()) {
    if (const auto shift = anchor_.by_own_tags(state_, known)) {
      memory_.forget_all();  // not anchored
      shift_axes(shift, report);
    }
    if (map_.whole != nullptr && anchor_.is_anchored()) follow_map(report);
  }
  sort(seen, known);
  gap_before_s_ = contradictions_.seconds_without_fit(seen.exposed_at);
  const double longest_s = has_imu() ? kLostAfterWithImu_s : kLostAfterWithoutImu_s;
  if (gap_before_s_ > longest_s) lose_motion(false);
  propagator_.forget_aim();
  // The motion is tracked from the first sighting of a tag.
  if (mode_ == FilterMode::kStarting && has_imu() && pose_finder_.knows_attitude() &&
      !tags_.fresh.empty())
    start_motion(seen.exposed_at);
}

/// Once the map is available it defines the workspace.
void TagFilter::follow_map(UpdateReport& report) {
  // Smaller shifts do not resemble a clock jump.
  constexpr double kNoticeable_m = 0.005;
  if (!held_tags_.has_changed(*map_.whole)) return;  // most images
  const auto statistics = image_update_.calibration().test_statistics(state_);
  const auto moved = held_tags_.take_over(state_, *map_.whole, has_imu());
  if (!moved) return;
  image_update_.follow_map(state_, *map_.whole, map_.body_id, *moved, statistics);
  memory_.forget_all();
  state_.forget_clones();
  anchor_.give_to_map();
  report.map_shift = moved;
  P_at_fit_ = position_covariance();
  const Eigen::Vector3d& p_WB = state_.X_WB.p;
  if ((p_WB - moved->inverse() * p_WB).norm() > kNoticeable_m) jump_search_.forget_all();
}

int TagFilter::move_to(const TagObservations& seen) {
  bool is_at_image = false;
  int iterations = 1;
  if (is_following()) {
    is_at_image = propagate_to(seen);
    if (propagator_.linearisation() != nullptr) iterations = kCornerStepIterations;
    if (has_imu() && gap_before_s_ > kCoasted_s) iterations = kFirstIterations;
    if (is_at_image && has_imu() && is_attitude_unknown(state_)) {
      lose_motion(true);
      is_at_image = false;
    }
  }
  if (mode_ == FilterMode::kLost) {
    is_at_image = !tags_.usable.empty() && relocalise(seen);
    iterations = kFirstIterations;
  }
  return is_at_image ? iterations : 0;
}

UpdateReport TagFilter::correct(const TagObservations& seen, int iterations) {
  const UpdateReport done = image_update_.correct(state_, propagator_.linearisation(), seen,
                                                  tags_.usable, gate_, iterations, tags_.accepted);
  for (std::size_t i = 0; i < tags_.usable.size(); ++i) {
    if (tags_.usable[i].local < 0 || !tags_.accepted[i]) continue;
    TagRecord& tag = state_.tags[static_cast<std::size_t>(tags_.usable[i].local)];
    ++tag.sightings;
    tag.last_seen = seen.exposed_at;
  }
  return done;
}

void TagFilter::correct(const TagObservations& seen, int iterations, UpdateReport& report) {
  p_before_ = state_.X_WB.p;
  P_before_ = position_covariance();
  const UpdateReport done = correct(seen, iterations);
  report.take_correction(done);
  report.tags_measured = done.tags_measured;
  report.corner_fits = done.corner_fits;
  for (std::size_t i = 0; i < tags_.usable.size(); ++i) {
    // Own tags do not confirm the map.
    const int local = tags_.usable[i].local;
    const bool own = local >= 0 && is_own(static_cast<std::size_t>(local));
    if (tags_.accepted[i] && !own) report.name_fitting(tags_.usable[i].seen->tag_id);
  }
  contradictions_.count(seen.camera, seen.exposed_at, tags_.usable, tags_.accepted);
  weigh_places(seen, report);
  if (done.tags_used > 0) note_place_fit(seen, report);
}

void TagFilter::correct_by_points(const TagObservations& seen, long image, UpdateReport& report) {
  if (!window_) return;
  const CameraClock& clock = state_.clocks[static_cast<std::size_t>(seen.camera)];
  // A clone has one exposure time: not for a rolling shutter.
  if (seen.points.size() < kFewestPoints || clock.rows_apart) return;
  CloneWindow::clone(state_, seen.camera, image);
  const LandmarkReport done =
      window_->correct(state_, memory_, image_update_.lens(seen.camera), seen.camera);
  report.landmarks_used = done.used;
  report.landmarks_rejected = done.rejected;
  report.landmark_nis = done.nis;
  report.landmark_nis_dof = done.nis_dof;
}

void TagFilter::shift_axes(const std::optional<Pose>& X_new_old, UpdateReport& report) {
  if (!X_new_old) return;
  report.gauge_shift = *X_new_old * report.gauge_shift.value_or(Pose{});
  memory_.move_axes(*X_new_old);
  image_update_.lose_motion();  // covariance in the old axes
  place_doubt_.turn(X_new_old->q);
  P_at_fit_ = position_covariance();
  jump_search_.forget_all();
  if (!has_imu()) candidates_.forget_all();  // views in the old axes
}

BodyEstimate TagFilter::estimate() const {
  FIDUCAP_ASSERT(running());
  BodyEstimate out = image_update_.body(state_);
  out.w_WB_B = -state_.bias_w;
  if (has_imu() && propagator_.imu().newest()) {
    const InertialInput input = propagator_.imu().input_between(state_.time, state_.time);
    out.w_WB_B = state_.imu.rate(input.w_B - state_.bias_w);
    out.a_WB = state_.X_WB.q * state_.imu.force(input.f_B - state_.bias_f) +
               Eigen::Vector3d(0, 0, -(sensors_.gravity_m_s2 + out.gravity_offset_m_s2));
  }
  out.anchored = anchor_.is_anchored();
  out.covariance.topLeftCorner<3, 3>() += place_doubt_.covariance();
  if (!has_imu() && config_.doubt_configuration) add_bend_of_prints(out);
  return out;
}

/// Remembers the nearest exact map tag: these are not in the state.
void TagFilter::note_exact_tags() {
  bool is_first = true;
  const Eigen::Vector3d p_WB = state_.X_WB.p;
  for (const TagToUse& tag : tags_.usable) {
    if (tag.local >= 0 || !tag.known->is_exact()) continue;
    const Eigen::Vector3d& p_WT = tag.known->X_WT.p;
    if (is_first || (p_WT - p_WB).norm() < (*exact_tag_W_ - p_WB).norm()) exact_tag_W_ = p_WT;
    is_first = false;
  }
}

/// Adds the covariance of bent paper relative to the nearest tag that defines W: of the map, the
/// reference tag or a surveyed tag. The map's covariance contains that of its own tags.
void TagFilter::add_bend_of_prints(BodyEstimate& body) const {
  const Eigen::Vector3d p_WB = body.X_WB.p;
  std::optional<Eigen::Vector3d> nearest = exact_tag_W_;
  for (std::size_t i = 0; i < state_.tags.size() && body.anchored; ++i) {
    const int tag_id = state_.tags[i].tag_id;
    if (is_own(i) && anchor_.defined_by() != tag_id && !priors_.contains(tag_id)) continue;
    const Eigen::Vector3d p_WT = tag_in_workspace(state_, i).X_WT.p;
    if (!nearest || (p_WB - p_WT).norm() < (p_WB - *nearest).norm()) nearest = p_WT;
  }
  if (nearest) body.covariance.topLeftCorner<6, 6>() += bend_of_print(p_WB - *nearest);
}

void TagFilter::tag_beliefs(std::vector<TagBelief>& out) const {
  out.clear();
  const int component = anchor_.is_anchored() ? TagBelief::kWorkspace : TagBelief::kOwnAxes;
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const auto& tag = state_.tags[i];
    if (!is_own(i)) continue;
    out.push_back(
        {tag_in_workspace(state_, i), tag.sightings, tag.first_seen, tag.last_seen, component});
  }
}

void TagFilter::mismatches(std::vector<FoundMismatch>& out) const {
  using Kind = FoundMismatch::Kind;
  out.clear();
  image_update_.list_mismatches(state_, out);
  const ImuBuffer::RangesMet& met = propagator_.imu().ranges_met();
  if (met.gyro_rad_s > 0) out.push_back({.kind = Kind::kGyroRange, .value = met.gyro_rad_s});
  if (met.accel_m_s2 > 0) out.push_back({.kind = Kind::kAccelRange, .value = met.accel_m_s2});
}

std::vector<ExtrinsicsEstimate> TagFilter::extrinsics() const {
  std::vector<ExtrinsicsEstimate> out;
  for (int c = 0; c < state_.cameras(); ++c) {
    out.push_back({state_.X_BV[static_cast<std::size_t>(c)], extrinsics_covariance(state_, c),
                   clock(c), image_update_.calibration().lens(state_, c)});
  }
  return out;
}

Explanation TagFilter::explain(const TagObservations& seen, const UpdateReport& report) const {
  const int unexplained = report.tags_seen - report.tags_used - report.tags_rejected;
  Explanation out{report.nis + gate_.of_tag * report.tags_rejected + kUnusedCost * unexplained,
                  kNumbersOfTag * report.tags_seen};
  // Normalisation term of the likelihood.
  const CornerNoise& noise = image_update_.noise(seen.camera);
  for (const TagObservation& tag : seen.tags)
    out.cost += 2.0 * kNumbersOfTag * std::log(noise.growth(tag));
  return out;
}

}  // namespace fiducap
