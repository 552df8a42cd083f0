#include "pipeline/body_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "base/process.hpp"
#include "detection/observe.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "mapping/moved_tags.hpp"

namespace fiducap {
namespace {

// The estimated cameras change slowly, and asking for them allocates.
constexpr Duration kCamerasPeriod = std::chrono::seconds(1);
// Time after a rejected tag for which rotations are compared: a clock that has jumped is found in
// two seconds.
constexpr Duration kRotationsCompared = std::chrono::seconds(5);
constexpr Duration kPauseOfImages = std::chrono::seconds(10);

/// Adds the CPU time of its scope.
class CpuMeter final {
 public:
  /// @param stands_for  number of equal calls, of which this one is measured
  explicit CpuMeter(Duration& sum, int stands_for = 1)
      : sum_(sum), stands_for_(stands_for), begin_(thread_cpu_time()) {}
  ~CpuMeter() { sum_ += stands_for_ * (thread_cpu_time() - begin_); }
  CpuMeter(const CpuMeter&) = delete;
  CpuMeter& operator=(const CpuMeter&) = delete;

 private:
  Duration& sum_;
  int stands_for_;
  Duration begin_;
};

int id_of_belief(const TagBelief& belief) { return belief.tag.tag_id; }

/// All images of the merger's window, so that images wait for their IMU readings, not for a full
/// queue.
std::size_t images_within_window(const PipelineSetup& setup) {
  constexpr double kMost = 64;  // of each camera
  double all = 0;
  for (const CameraMount& camera : setup.sensors.cameras)
    all += std::min(std::ceil(camera.rate_hz * to_seconds(setup.merger.window)) + 2, kMost);
  return std::max<std::size_t>(setup.merger.max_images, static_cast<std::size_t>(all));
}

MergerConfig merger_of(const PipelineSetup& setup) {
  MergerConfig config = setup.merger;
  config.has_imu = setup.sensors.imu.has_value();
  config.cameras = static_cast<int>(setup.sensors.cameras.size());
  config.max_images = images_within_window(setup);
  // An IMU has no pauses; images alone may have pauses.
  if (!config.has_imu) config.jump = std::max(config.jump, kPauseOfImages);
  return config;
}

}  // namespace

BodyPipeline::BodyPipeline(PipelineSetup setup, std::unique_ptr<BodyFilter> filter)
    : setup_(std::move(setup)),
      merger_(merger_of(setup_)),
      filter_(
          filter ? std::move(filter)
                 : make_body_filter(setup_.filter, setup_.sensors, setup_.gauge, setup_.estimator)),
      doubts_(setup_.sensors, setup_.gauge, !setup_.priors.empty()),
      agreement_(setup_.sensors, setup_.estimator.corner_noise_px),
      late_(setup_.sensors.cameras.size()) {
  const bool all = setup_.segments_hold_every_image;
  if (setup_.records_segments) segments_.emplace(setup_.sensors, setup_.estimator, all);
  if (segments_) filter_->observe_starts(segments_->make_new());
  filter_->set_tag_priors(setup_.priors);
  for (int camera = 0; camera < static_cast<int>(setup_.sensors.cameras.size()); ++camera)
    merger_.set_clock_shift(camera, shift_to_apply(filter_->clock(camera), Duration{0}));
}

bool BodyPipeline::push(SensorSample sample) {
  if (const auto* imu = std::get_if<ImuSample>(&sample)) {
    newest_imu_ = imu->sampled_at;
    agreement_.add(*imu);  // with a clock far off, the merger drops samples that are needed here
    imu_silence_.reading_arrived(imu->sampled_at);
    return merger_.push(std::move(sample));
  }
  const int camera = camera_of(sample);
  const Instant stamp = time_of(sample);
  imu_silence_.image_arrived(stamp);
  const std::uint64_t late_before = merger_.statistics().late_dropped;
  const bool has_room = merger_.push(std::move(sample));
  note_late(camera, stamp, merger_.statistics().late_dropped > late_before);
  return has_room;
}

/// Images of an excluded camera get the time of arrival: they are not dropped, so that their turns
/// are compared with the gyro's and the cause is found.
void BodyPipeline::note_late(int camera, Instant stamp, bool was_dropped) {
  if (!newest_imu_) return;
  using enum LateImages::Change;
  const auto change = late_.note(camera, stamp, was_dropped, *newest_imu_);
  if (change == kExcluded) merger_.set_clock_shift(camera, *newest_imu_ - stamp);
  if (change != kInTime) return;
  merger_.set_clock_shift(camera, shift_to_apply(filter_->clock(camera), {}));
  reported_.late.reset(static_cast<std::size_t>(camera));
}

void BodyPipeline::finish() { merger_.finish(); }

const SensorSample* BodyPipeline::next() {
  if (!next_) next_ = merger_.pop();
  return next_ ? &*next_ : nullptr;
}

bool BodyPipeline::next_is_image() {
  const SensorSample* sample = next();
  return sample != nullptr && !std::holds_alternative<ImuSample>(*sample);
}

void BodyPipeline::skip() {
  next_.reset();
  ++statistics_.skipped;
}

const BodyUpdate* BodyPipeline::take(const MapView& view) {
  FIDUCAP_ASSERT(next() != nullptr);
  const BodyUpdate* update = nullptr;
  if (const auto* imu = std::get_if<ImuSample>(&*next_)) {
    take_imu(*imu);
  } else {
    update = take_image(view);
  }
  next_.reset();
  return update;
}

void BodyPipeline::take_imu(const ImuSample& imu) {
  // Reading the clock twice takes as long as a sample.
  constexpr int kMeasured = 16;
  std::optional<CpuMeter> meter;
  if (statistics_.imu_samples % kMeasured == 0) meter.emplace(statistics_.propagate_cpu, kMeasured);
  filter_->propagate(imu);
  if (segments_) segments_->add(imu);
  if (search_) search_->add_imu(imu);
  plausibility_.add(imu);
  imu_silence_.reading_used(imu.sampled_at);
  ++statistics_.imu_samples;
}

const BodyUpdate* BodyPipeline::take_image(const MapView& view) {
  find_corners(view);
  const CpuMeter meter(statistics_.update_cpu);
  const CornerFrame& corners = update_.corners;
  const auto camera = static_cast<std::size_t>(corners.camera);
  update_.events.clear();
  observe(corners, setup_.sensors.cameras[camera].model, setup_.tags, setup_.detector,
          update_.seen);
  const bool fits = !rejected_at_ || corners.exposed_at - *rejected_at_ > kRotationsCompared;
  agreement_.add(update_.seen, fits && !update_.withheld);
  if (late_.excludes(corners.camera, corners.exposed_at - corners.clock_shift))
    return take_excluded_image();
  lose_motion_if_lost();
  view.map->known_among(update_.seen, update_.known);
  const KnownMap* const whole = contradicted_.use(*view.map, update_.known);
  update_.report = filter_->update(update_.seen,
                                   {update_.known, view.may_define_workspace, whole, view.body_id});
  if (update_.report.tags_rejected > 0) rejected_at_ = corners.exposed_at;
  const ClockEstimate clock = filter_->clock(corners.camera);
  merger_.set_clock_shift(corners.camera, shift_to_apply(clock, corners.clock_shift));
  agreement_.set_used_shift(corners.camera, clock.shift_s);
  note_contradicted(*view.map);
  filter_->tag_beliefs(update_.beliefs);
  contradicted_.compare(update_.beliefs, update_.contradicted);
  if (segments_) {
    segments_->add(update_.seen, *filter_, update_.report, update_.beliefs, update_.known);
    update_.segment = contradicted_.without(segments_->take());
  }
  if (setup_.sensors.imu)
    imu_silence_.image_used(corners.exposed_at, corners.exposed_at - corners.clock_shift);
  note_turns();
  note_trust();
  note_shown();
  update_.estimate.reset();
  if (filter_->running() && !update_.withheld) update_.estimate = filter_->estimate();
  refresh_cameras();
  if (search_) search_->learn(update_.estimate, update_.cameras);
  note_events();
  note_carried();
  ++statistics_.frames;
  statistics_.tags_used += static_cast<std::uint64_t>(update_.report.tags_used);
  if (anchored_ && !update_.doubted && update_.report.tags_used > 0) ++statistics_.frames_with_pose;
  return &update_;
}

/// Its time is unknown, so the filter does not get it.
const BodyUpdate* BodyPipeline::take_excluded_image() {
  update_.report = {};
  update_.report.exposed_at = update_.seen.exposed_at;
  update_.known.clear();
  update_.contradicted.clear();
  update_.segment.reset();
  const int camera = update_.corners.camera;
  const auto bit = static_cast<std::size_t>(camera);
  if (late_.is_excluded(camera) && !reported_.late.test(bit)) {
    reported_.late.set(bit);
    note(BodyEvent::Kind::kTurnsDisagree, late_.text(camera));
  }
  note_turns();
  note_shown();
  update_.estimate.reset();
  ++statistics_.frames;
  return &update_;
}

/// Into `update_.corners`.
void BodyPipeline::find_corners(const MapView& view) {
  if (auto* delivered = std::get_if<CornerFrame>(&*next_)) {
    update_.corners = std::move(*delivered);
    return;
  }
  const CpuMeter meter(statistics_.detect_cpu);
  if (!search_) search_.emplace(setup_.sensors, setup_.tags, setup_.detector, setup_.estimator);
  const auto& image = std::get<CameraFrame>(*next_);
  update_.corners = search_->search(image, update_.beliefs, *view.map);
}

/// Dropped tags whose pose in the map is wrong. A tag that the body had elsewhere than the map was
/// the body's own error, and so were contradictions of a body that was lost.
void BodyPipeline::note_contradicted(const TagMap& map) {
  update_.contradicted.clear();
  const auto named = update_.report.named_dropped();
  std::vector<int> dropped(named.begin(), named.end());
  if (update_.report.relocalised || update_.report.generation != generation_) {
    std::erase_if(dropped, [&](int tag_id) { return contradicted_.contains(tag_id); });
    contradicted_.forget_all();
  }
  if (!anchored_ || update_.report.start_is_open) return;
  for (const int tag_id : dropped) {
    const auto own = std::ranges::find(update_.beliefs, tag_id, id_of_belief);
    const auto known = std::ranges::find(update_.known, tag_id, &KnownTag::tag_id);
    const bool is_own_error = own != update_.beliefs.end() && known != update_.known.end() &&
                              !is_near(own->tag.X_WT, known->X_WT);
    if (is_own_error) continue;
    update_.contradicted.push_back(tag_id);
    contradicted_.add(map, tag_id);
  }
}

void BodyPipeline::lose_motion_if_lost() {
  if (!anchored_ || !carried_at_) return;
  if (to_seconds(update_.seen.exposed_at - *carried_at_) <= setup_.lose_after_s) return;
  filter_->lose_motion();
  if (segments_) segments_->break_chain();
  ++statistics_.motion_losses;
  note(BodyEvent::Kind::kMotionLost);
  carried_at_.reset();
}

void BodyPipeline::refresh_cameras() {
  if (!update_.estimate) return;
  const Instant now = update_.seen.exposed_at;
  if (cameras_at_ && now >= *cameras_at_ && now - *cameras_at_ < kCamerasPeriod) return;
  cameras_at_ = now;
  update_.cameras = filter_->extrinsics();
}

BodyEvent& BodyPipeline::note(BodyEvent::Kind kind, std::string text) {
  return update_.events.emplace_back(
      BodyEvent{.kind = kind, .at = update_.seen.exposed_at, .text = std::move(text)});
}

void BodyPipeline::note_events() {
  const UpdateReport& done = update_.report;
  if (generation_ >= 0 && done.generation != generation_) note(BodyEvent::Kind::kReset);
  generation_ = done.generation;
  if (done.relocalised) note(BodyEvent::Kind::kRelocalised);
  if (done.gauge_shift) note(BodyEvent::Kind::kGaugeShift).shift = *done.gauge_shift;
  report(BodyEvent::Kind::kMapCorrection, corrections_.add(done, update_.estimate));
  const bool anchored = update_.estimate && update_.estimate->anchored;
  if (anchored && !anchored_) note(BodyEvent::Kind::kAnchored);
  anchored_ = anchored;
  if (done.tags_rejected > 0 && done.tags_used == 0) note(BodyEvent::Kind::kImageRejected);
  for (const int tag_id : done.named_dropped()) note(BodyEvent::Kind::kTagDropped).tag_id = tag_id;
  note_imu();
  note_mismatches();
  report(BodyEvent::Kind::kDoubt,
         doubts_.add(update_.seen, done, update_.estimate, update_.beliefs, update_.known));
}

void BodyPipeline::note_mismatches() {
  if (update_.withheld) return;  // a clock or axes are wrong, which has a message of its own
  const Instant now = update_.seen.exposed_at;
  if (mismatches_at_ && now >= *mismatches_at_ && now - *mismatches_at_ < kCamerasPeriod) return;
  mismatches_at_ = now;
  filter_->mismatches(found_);
  for (const FoundMismatch& one : mismatches_.take(found_, now))
    note(BodyEvent::Kind::kMismatch, mismatch_text(one, setup_.sensors.cameras)).tag_id =
        one.tag_id;
}

void BodyPipeline::note_turns() {
  if (const auto& jump = update_.report.clock_jump)
    note(BodyEvent::Kind::kClockJumped, agreement_.note_jump(*jump)).clock_jump =
        from_seconds(jump->change_s);
  while (const auto found = agreement_.take_report()) {
    using Found = AgreementFinding::Kind;
    const AgreementFinding& finding = found->finding;
    if (finding.kind == Found::kAgree) continue;  // reported when poses are published again
    if (finding.kind != Found::kJumped) {
      note(BodyEvent::Kind::kTurnsDisagree, found->text);
      continue;
    }
    note(BodyEvent::Kind::kClockJumped, found->text).clock_jump = from_seconds(finding.jump_s);
    filter_->note_clock_jump(found->camera, finding.fit.shift_s, finding.fit.shift_sigma_s);
    trust_.note_clock_jump();
  }
}

void BodyPipeline::note_trust() {
  const bool is_established = agreement_.is_established() || !setup_.sensors.imu;
  const auto is_own = [&](const KnownTag& known) {
    return std::ranges::count(update_.beliefs, known.tag_id, id_of_belief) > 0;
  };
  const bool is_room_known = !std::ranges::all_of(update_.known, is_own);
  trust_.add(update_.report, is_established, is_room_known);
  // A wrong clock or wrong axes have a message of their own.
  const bool is_contradicted = trust_.is_contradicted() && !agreement_.withholds();
  if (is_contradicted && !reported_.contradiction)
    note(BodyEvent::Kind::kTurnsDisagree, contradiction_text(is_established));
  reported_.contradiction = is_contradicted;
}

void BodyPipeline::note_shown() {
  update_.withheld = agreement_.withholds() || late_.excludes_any() || imu_silence_.lags();
  const auto is_reason = [](const BodyEvent& event) {
    return event.kind == BodyEvent::Kind::kTurnsDisagree ||
           event.kind == BodyEvent::Kind::kClockJumped;
  };
  update_.doubted = trust_.withholds();
  update_.is_untested = trust_.is_untested();
  if (update_.withheld || update_.doubted) {
    reported_.disagreement |= std::ranges::any_of(update_.events, is_reason);
  } else if (std::exchange(reported_.disagreement, false)) {
    note(BodyEvent::Kind::kTurnsAgree, "images fit again: poses are published");
  }
}

void BodyPipeline::note_imu() {
  const bool silent = imu_silence_.is_silent();
  if (std::exchange(reported_.silence, silent) != silent)
    note(silent ? BodyEvent::Kind::kImuSilent : BodyEvent::Kind::kImuBack,
         std::string(imu_silence_.text()));
  const ImuFaults before =
      std::exchange(reported_.imu, plausibility_.faults(agreement_.has_degrees()));
  if (before == reported_.imu) return;
  for (const ImuFault fault : faults_to_report(before, reported_.imu))
    note(is_fatal(fault) ? BodyEvent::Kind::kImuUnusable : BodyEvent::Kind::kImuDoubtful,
         plausibility_.text(fault));
  if (reported_.imu == ImuFaults{})
    note(BodyEvent::Kind::kImuPlausible, "the IMU's readings are plausible again");
}

/// See BodyTracker: a used or new tag ties the body to the workspace, and so do followed points for
/// some time.
void BodyPipeline::note_carried() {
  const UpdateReport& report = update_.report;
  const bool by_points = report.landmarks_used >= filter_rules::kLandmarksToStay && carried_at_;
  if (by_points || report.tags_used + report.tags_added > 0) carried_at_ = report.exposed_at;
}

PipelineStatistics BodyPipeline::statistics() const {
  PipelineStatistics all = statistics_;
  all.merger = merger_.statistics();
  if (search_) all.search = search_->statistics();
  return all;
}

}  // namespace fiducap
