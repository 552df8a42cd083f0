#include "capture/sample_merger.hpp"

#include <algorithm>
#include <utility>

#include "base/expected.hpp"

namespace fiducap {
namespace {

// Images of a slow camera may be minutes apart; a stamp of another epoch is years away.
constexpr Duration kForeign = std::chrono::hours(1);

std::size_t sensor_of(const SensorSample& sample) {
  if (std::holds_alternative<ImuSample>(sample)) return 0;
  const int camera = camera_of(sample);
  FIDUCAP_ASSERT(camera >= 0 && camera < kMostCameras);
  return static_cast<std::size_t>(camera) + 1;
}

bool is_sound(const CameraFrame& frame) {
  return frame.image && frame.image->width > 0 && frame.image->height > 0 &&
         frame.image->pixels.size() == static_cast<std::size_t>(frame.image->width) *
                                           static_cast<std::size_t>(frame.image->height);
}

bool is_sound(const SensorSample& image) {
  if (const auto* frame = std::get_if<CameraFrame>(&image)) return is_sound(*frame);
  return has_finite_corners(std::get<CornerFrame>(image));
}

/// Replaces the former shift.
void apply_shift(SensorSample& image, Duration shift) {
  const auto apply = [&](auto& frame) {
    frame.exposed_at += shift - frame.clock_shift;
    frame.clock_shift = shift;
  };
  if (auto* frame = std::get_if<CameraFrame>(&image)) return apply(*frame);
  apply(std::get<CornerFrame>(image));
}

bool comes_before(const SensorSample& a, const SensorSample& b) {
  return std::pair(time_of(a), camera_of(a)) < std::pair(time_of(b), camera_of(b));
}

}  // namespace

JumpGate::JumpGate(Duration jump) : jump_(jump) { out_.reserve(held_.size() + 1); }

std::vector<SensorSample>& JumpGate::take(SensorSample sample) {
  out_.clear();
  const Instant at = time_of(sample);
  Held& own = held_[sensor_of(sample)];
  bool is_sure = !is_far_ahead(at);
  if (waiting_ > 0) {
    if (own) {  // its sensor's next sample confirms or drops it
      const Duration ahead = at - time_of(*own);
      if (ahead >= -jump_ && ahead <= kForeign)
        pass_held(own);
      else
        drop(own);
    }
    for (Held& held : held_) {
      if (!held || std::chrono::abs(at - time_of(*held)) > jump_) continue;
      pass_held(held);
      is_sure = true;
    }
  }
  if (is_sure || !is_far_ahead(at)) {
    pass(std::move(sample));
  } else {
    own = std::move(sample);
    ++waiting_;
  }
  return out_;
}

std::vector<SensorSample>& JumpGate::finish() {
  out_.clear();
  const bool nothing_seen = !newest_;
  for (Held& held : held_) {
    if (!held) continue;
    if (nothing_seen || !is_far_ahead(time_of(*held)))
      pass_held(held);
    else
      drop(held);
  }
  return out_;
}

void JumpGate::pass(SensorSample sample) {
  const Instant at = time_of(sample);
  newest_ = newest_ ? std::max(*newest_, at) : at;
  out_.push_back(std::move(sample));
}

int camera_of(const SensorSample& sample) {
  if (const auto* image = std::get_if<CameraFrame>(&sample)) return image->camera;
  const auto* corners = std::get_if<CornerFrame>(&sample);
  return corners != nullptr ? corners->camera : -1;
}

bool has_finite_corners(const CornerFrame& frame) {
  return std::ranges::all_of(frame.tags, [](const TagSighting& tag) {
    return std::ranges::all_of(tag.corners_px,
                               [](const Eigen::Vector2d& px) { return px.allFinite(); });
  });
}

SampleMerger::SampleMerger(const MergerConfig& config) : config_(config), gate_(config.jump) {
  FIDUCAP_ASSERT(config.cameras >= 0 && config.cameras <= kMostCameras);
  FIDUCAP_ASSERT(config.max_images > 0 && config.max_imu > 0 && config.window > Duration{0});
  if (config_.has_imu) imu_.resize(config_.max_imu);
  images_.reserve(config_.max_images + 1);
}

bool SampleMerger::push(SensorSample sample) {
  FIDUCAP_ASSERT(!finished_);
  if (!config_.has_imu && std::holds_alternative<ImuSample>(sample)) return true;
  if (!is_good(sample)) {
    ++statistics_.bad_dropped;
    return true;
  }
  bool has_room = true;
  for (SensorSample& admitted : gate_.take(std::move(sample)))
    has_room = admit(std::move(admitted)) && has_room;
  return has_room;
}

bool SampleMerger::is_good(const SensorSample& sample) const {
  if (const auto* imu = std::get_if<ImuSample>(&sample))
    return imu->w_WB_B.allFinite() && imu->f_B.allFinite();
  const int camera = camera_of(sample);
  return camera >= 0 && camera < config_.cameras && is_sound(sample);
}

bool SampleMerger::admit_imu(const ImuSample& sample) {
  if (newest_imu_ && sample.sampled_at <= *newest_imu_) {
    ++statistics_.backwards_dropped;
    return true;
  }
  if (imu_waiting_ == imu_.size()) return false;
  newest_imu_ = sample.sampled_at;
  note_time(sample.sampled_at);
  if (released_image_ && sample.sampled_at < *released_image_) {
    ++statistics_.late_dropped;
    return true;
  }
  imu_[(imu_begin_ + imu_waiting_) % imu_.size()] = sample;
  ++imu_waiting_;
  return true;
}

void SampleMerger::admit_image(SensorSample sample) {
  const int camera = camera_of(sample);
  apply_shift(sample, clock_shift_[static_cast<std::size_t>(camera)]);
  const Instant at = time_of(sample);
  std::optional<Instant>& newest = newest_image_[static_cast<std::size_t>(camera)];
  if (newest && at <= *newest) {
    ++statistics_.backwards_dropped;
    return;
  }
  newest = at;
  note_time(at);
  if (is_late(at)) {
    ++statistics_.late_dropped;
    return;
  }
  images_.insert(std::upper_bound(images_.begin(), images_.end(), sample, comes_before),
                 std::move(sample));
  if (images_.size() > config_.max_images) {
    images_.erase(images_.begin());
    ++statistics_.images_dropped;
  }
}

void SampleMerger::set_clock_shift(int camera, Duration shift) {
  FIDUCAP_ASSERT(camera >= 0 && camera < kMostCameras);
  Duration& applied = clock_shift_[static_cast<std::size_t>(camera)];
  if (applied == shift) return;
  if (std::optional<Instant>& newest = newest_image_[static_cast<std::size_t>(camera)])
    *newest += shift - applied;
  applied = shift;
  for (SensorSample& image : images_)
    if (camera_of(image) == camera) apply_shift(image, shift);
  // Those that are now before the last released sample are late.
  statistics_.late_dropped +=
      std::erase_if(images_, [this](const SensorSample& image) { return is_late(time_of(image)); });
  std::ranges::sort(images_, comes_before);
}

std::optional<SensorSample> SampleMerger::pop() {
  if (image_is_due()) return take_image();
  if (imu_is_due()) {
    const ImuSample sample = imu_[imu_begin_];
    imu_begin_ = (imu_begin_ + 1) % imu_.size();
    --imu_waiting_;
    released_imu_before_ = std::exchange(released_imu_, sample.sampled_at);
    return sample;
  }
  if (imu_wait_is_over()) {
    ++statistics_.imu_waits_expired;
    return take_image();
  }
  return std::nullopt;
}

bool SampleMerger::imu_is_due() const {
  if (imu_waiting_ == 0) return false;
  if (finished_ || !released_imu_) return true;
  // Images up to the IMU sample last released belong before the next one.
  if (!images_.empty() && time_of(images_.front()) <= *released_imu_) return false;
  if (has_passed_window(*released_imu_)) return true;
  const bool some_camera_is_active = std::ranges::any_of(
      newest_image_, [this](const auto& newest) { return newest && !has_passed_window(*newest); });
  return some_camera_is_active && images_are_complete_before(*released_imu_);
}

bool SampleMerger::imu_wait_is_over() const {
  if (!config_.has_imu || images_.empty() || imu_waiting_ > 0) return false;
  const Instant at = time_of(images_.front());
  if (released_imu_ && *released_imu_ >= at) return false;  // waits for another camera
  return finished_ || has_passed_window(at) || images_.size() >= config_.max_images;
}

}  // namespace fiducap
