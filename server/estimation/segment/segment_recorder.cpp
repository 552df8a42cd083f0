#include "estimation/segment/segment_recorder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/segment/segment_cutting.hpp"

namespace fiducap {

namespace {
// Bound of the segments held back during a start.
constexpr std::size_t kMostHeldBack = 60;

BodyMoment moment_of(const BodyEstimate& body) {
  return {body.at, body.X_WB, body.v_WB, body.bias_f, body.bias_w};
}
}  // namespace

SegmentRecorder::SegmentRecorder(const BodySensors& sensors, const EstimatorConfig& config,
                                 bool holds_every_image)
    : sensors_(sensors),
      config_(config),
      holds_every_image_(holds_every_image),
      imu_(sensors.imu.value_or(ImuNoise{}), config.max_imu_gap_s, config.motion_accel_m_s2_rtHz) {
  open_.sensors = std::make_shared<const SegmentSensors>(SegmentSensors{
      sensors.cameras, sensors.imu.has_value(), sensors.gravity_m_s2, config.estimate_extrinsics,
      config.estimate_clocks, sensors.gravity_sigma_m_s2});
}

void SegmentRecorder::add(const ImuSample& imu) {
  if (!sensors_.imu || !imu_.push(imu)) return;
  if (!is_open_) return imu_.keep_newest_pair();
  if (imu_.is_full()) integrate_to(imu_.before_newest().sampled_at, 1.0);
}

/// Poses may be in previous axes.
void SegmentRecorder::break_chain() {
  is_open_ = false;
  places_.clear();
}

void SegmentRecorder::finish(const BodyFilter& filter) {
  if (is_open_ && filter.running() && open_.instances.size() > 1) {
    open_.anchored = filter.estimate().anchored;
    end(filter);
  }
  break_chain();
}

std::shared_ptr<const MotionSegment> SegmentRecorder::take() {
  if (done_.empty() || start_is_open_) return nullptr;
  std::shared_ptr<const MotionSegment> out = std::move(done_.front());
  done_.pop_front();
  return out;
}

void SegmentRecorder::add(const TagObservations& seen, BodyFilter& filter,
                          const UpdateReport& report, std::span<const TagBelief> beliefs,
                          std::span<const KnownTag> known) {
  if (const auto start = filter.take_start()) {
    // Continues with the record of the selected start, which ends at the present image.
    *this = std::move(static_cast<SegmentRecorder&>(*start));
    generation_ = report.generation;
    start_is_open_ = report.start_is_open;
    return;
  }
  start_is_open_ = report.start_is_open;
  if (report.generation != generation_ || report.start_changed) {
    break_chain();
    if (start_is_open_ || report.start_changed) done_.clear();
  }
  generation_ = report.generation;
  if (!filter.running() || report.relocalised || report.clock_jump || report.ambiguous_place)
    return break_chain();
  const BodyEstimate body = filter.estimate();
  if (body.at != seen.exposed_at) return;  // without IMU: not propagated here
  if (report.gauge_shift) shift_axes(*report.gauge_shift);
  if (report.map_shift) shift_axes(*report.map_shift);
  if (is_open_ && body.at - of_use_at_ > kLongestBlind) break_chain();
  if (start_is_open_) filter.own_tags(own_tags_);
  for (const TagBelief& belief : start_is_open_ ? std::span<const TagBelief>(own_tags_) : beliefs)
    places_[belief.tag.tag_id] = belief.tag;
  for (const KnownTag& tag : known)
    if (body.anchored) places_.try_emplace(tag.tag_id, tag);
  SegmentImage image = segment_image(seen, filter, config_);
  const bool is_of_use = std::ranges::any_of(
      image.tags, [&](const auto& s) { return places_.contains(s.seen.tag_id); });
  if (is_of_use) of_use_at_ = body.at;
  if (!is_open_) {
    if (!is_of_use) return places_.clear();
    ++chain_;
    begin(body);
    open_.instances.back().images.push_back(std::move(image));
    return;
  }
  integrate_to(body.at, filter.learned(seen.camera).imu_variance);
  if (image.tags.empty() && !holds_every_image_) return;
  if (open_.instances.back().body.at != body.at)
    open_.instances.push_back({moment_of(body), std::exchange(steps_, {}), {}});
  open_.instances.back().images.push_back(std::move(image));
  if (is_of_use && body.at - open_.begin().at >= kSegmentLength) {
    open_.anchored = body.anchored;
    end(filter);
    begin(body);
  }
}

void SegmentRecorder::begin(const BodyEstimate& body) {
  open_.chain = chain_;
  open_.anchored = body.anchored;
  open_.instances.clear();
  open_.instances.push_back({moment_of(body), {}, {}});
  open_.cameras.clear();
  open_.tags.clear();
  steps_.clear();
  reached_ = body.at;
  imu_.forget_before(body.at);
  is_open_ = true;
}

void SegmentRecorder::end(const BodyFilter& filter) {
  keep_placed(places_, open_);
  places_.clear();
  open_.cameras = camera_beliefs(filter, sensors_.cameras);
  const BodyEstimate body = filter.estimate();
  open_.gravity_offset_m_s2 = body.gravity_offset_m_s2;
  open_.imu = body.imu;
  filter.mismatches(open_.found);
  const auto sensors = open_.sensors;
  done_.push_back(std::make_shared<const MotionSegment>(std::move(open_)));
  if (done_.size() > kMostHeldBack) done_.pop_front();
  open_ = {};
  open_.sensors = sensors;
}

std::vector<CameraBelief> camera_beliefs(const BodyFilter& filter,
                                         std::span<const CameraMount> mounts) {
  std::vector<CameraBelief> beliefs;
  for (const ExtrinsicsEstimate& camera : filter.extrinsics()) {
    const auto c = beliefs.size();
    const CameraMount& mount = mounts[c];
    beliefs.push_back({.X_BV = camera.X_BV,
                       .shift_s = camera.clock.shift_s,
                       .readout_s = camera.clock.readout_s,
                       .rows_apart = mount.readout_s != 0 || mount.readout_sigma_s != 0 ||
                                     camera.clock.readout_s != 0,
                       .lens = camera.lens.offset,
                       .lens_is_open = !camera.lens.offset.is_none()});
  }
  return beliefs;
}

SegmentImage segment_image(const TagObservations& seen, const BodyFilter& filter,
                           const EstimatorConfig& config) {
  const LearnedSensors learned = filter.learned(seen.camera);
  SegmentImage image{seen.camera, to_seconds(seen.clock_shift), learned.jitter_s, {}};
  for (const TagObservation& tag : seen.tags) {
    SegmentSighting sighting;
    sighting.seen = tag;
    sighting.noise_px =
        learned.corners != nullptr ? learned.corners->of(tag) : config.corner_noise_px;
    sighting.is_even = learned.corners == nullptr || !learned.corners->is_uneven(tag);
    if (!sighting.is_even) sighting.covariance = learned.corners->covariance(tag, 0);
    image.tags.push_back(std::move(sighting));
  }
  return image;
}

void SegmentRecorder::shift_axes(const Pose& X_new_old) {
  for (MotionSegment::Instance& instance : open_.instances)
    instance.body = in_other_axes(X_new_old, instance.body);
  for (auto& [tag_id, tag] : places_) tag.X_WT = X_new_old * tag.X_WT;
}

void SegmentRecorder::integrate_to(Instant to, double imu_variance) {
  if (!sensors_.imu) {
    const InertialInput input = motion_without_imu(config_);
    return add_step(to, input, from_seconds(filter_rules::kStepWithoutImu_s));
  }
  const double factor = std::sqrt(imu_variance);
  while (reached_ < to) {
    const Instant end = imu_.end_of_interval(reached_, to);
    InertialInput input = imu_.input_between(reached_, end);
    input.scale_noise(factor);
    add_step(end, input, from_seconds(filter_rules::kStepWithImu_s));
  }
  imu_.forget_before(to);
}

void SegmentRecorder::add_step(Instant to, const InertialInput& input, Duration longest) {
  if (reached_ >= to) return;
  add_steps(to - reached_, input, longest, steps_);
  reached_ = to;
}

}  // namespace fiducap
