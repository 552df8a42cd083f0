// The world filter's clocks, and its start with a clock that turns out to be far off.
//
// A camera's time shift and the motion enter the images as a product. While both are vague, in a quick turn, a linear filter
// becomes sure of wrong velocities and biases, and takes wrong branches. Its estimate of the shift itself moves the right way. So
// what came in since the start is kept for some seconds, and when the shift has moved far since then, all of it is lived through
// again from there, until it moves no more: as if the shift had been known from the beginning (an iterated filter over the start).
#include <algorithm>
#include <array>
#include <cmath>

#include "estimation/filter_rules.hpp"
#include "estimation/world/world_filter.hpp"

namespace fiducap::world {

namespace {
// When the start is looked at, after the first tag.
constexpr std::array kLooks_s{1.0, 2.0, 4.0, 6.0};
constexpr int kMostLivesPerLook = 6;
constexpr double kFarOff_s = 0.003;
constexpr double kSure_sigma = 3.0;
// No shift is believed that the prior calls impossible.
constexpr double kMost_sigma = 6.0;
// While a clock is worse known than this, the map is not told of tags: they may be taken back.
constexpr double kVague_s = 0.002;
}  // namespace

void WorldFilter::look_at(const TagObservations& seen) {
  state_.clocks[static_cast<std::size_t>(seen.camera)].applied_s = to_seconds(seen.clock_shift);
}

ClockEstimate WorldFilter::clock(int camera) const {
  const CameraClock& clock = state_.clocks[static_cast<std::size_t>(camera)];
  const int at = layout::clock(camera);
  return {clock.shift_s, std::sqrt(state_.P()(at, at)), clock.readout_s, std::sqrt(state_.P()(at + 1, at + 1))};
}

void WorldFilter::reopen_clock(int camera) {
  if (!config_.estimate_clocks || !has_imu()) return;
  const int at = layout::clock(camera);
  const double sigma = sensors_.cameras[static_cast<std::size_t>(camera)].time_shift_sigma_s;
  auto P = state_.P();
  P.row(at).setZero();
  P.col(at).setZero();
  P(at, at) = sigma * sigma;
  for (WorldTag& tag : state_.tags) tag.rejected_in_row = 0;  // the clock is to blame, not they
}

void WorldFilter::begin_log() {
  start_log_ = StartLog{};
  if (!has_imu() || !config_.estimate_clocks) start_log_.close();
  looks_at_start_ = 0;
  start_shifts_s_.clear();
  for (std::size_t k = 0; k < sensors_.cameras.size(); ++k) start_shifts_s_.push_back(first_shift_of(k));
}

void WorldFilter::log_start(const TagObservations& seen, std::span<const KnownTag> known) {
  if (!start_log_.is_open()) return;
  if (looks_at_start_ == kLooks_s.size()) return start_log_.close();
  start_log_.add(seen, known);
}

UpdateReport WorldFilter::relive_start_if_due(const UpdateReport& report) {
  if (!start_log_.is_open() || looks_at_start_ == kLooks_s.size() || mode_ != Mode::kRunning) return report;
  const bool due = start_log_.seconds_since_first_tag(report.exposed_at) >= kLooks_s[looks_at_start_];
  const bool strained = strained_updates_ == filter_rules::kStrainedToReopenClock;
  if (!due && !strained) return report;
  looks_at_start_ += due ? 1 : 0;
  UpdateReport last = report;
  for (int life = 0; life < kMostLivesPerLook && clock_was_far_off(); ++life) last = relive_start(last);
  return last;
}

bool WorldFilter::clock_was_far_off() const {
  for (int camera = 0; camera < state_.cameras(); ++camera) {
    const auto k = static_cast<std::size_t>(camera);
    const ClockEstimate now = clock(camera);
    const double moved_s = std::abs(now.shift_s - start_shifts_s_[k]);
    const bool possible = std::abs(now.shift_s - first_shift_of(k)) < kMost_sigma * sensors_.cameras[k].time_shift_sigma_s;
    if (possible && moved_s > std::max(kFarOff_s, kSure_sigma * now.shift_sigma_s)) return true;
  }
  return false;
}

bool WorldFilter::clock_is_vague() const {
  for (int camera = 0; camera < state_.cameras(); ++camera) {
    if (clock(camera).shift_sigma_s > kVague_s) return true;
  }
  return false;
}

UpdateReport WorldFilter::relive_start(const UpdateReport& report) {
  const bool was_anchored = anchor_ != Anchor::kNone;
  const Pose X_WB_before = state_.X_WB;
  for (int camera = 0; camera < state_.cameras(); ++camera) start_shifts_s_[static_cast<std::size_t>(camera)] = clock(camera).shift_s;
  StartLog log = std::move(start_log_);
  start_log_.close();
  reliving_ = true;
  restart();
  imu_.forget_all();
  corner_noise_.assign(corner_noise_.size(), CornerNoise(config_, config_.learn_corner_noise));
  log.shift_images(start_shifts_s_);
  UpdateReport last = report;
  auto imu = log.imu().begin();
  for (const StartLog::Image& image : log.images()) {
    // Up to the first reading at or after the image, as SampleMerger has it.
    for (bool covered = false; imu != log.imu().end() && !covered; ++imu) {
      covered = imu->sampled_at >= image.seen.exposed_at;
      propagate(*imu);
    }
    last = process(image.seen, image.known);
  }
  for (; imu != log.imu().end(); ++imu) propagate(*imu);
  reliving_ = false;
  start_log_ = std::move(log);
  last.gauge_shift.reset();
  if (!was_anchored) last.gauge_shift = state_.X_WB * X_WB_before.inverse();
  return last;
}

}  // namespace fiducap::world
