// The world filter's clocks, and its start while they are unknown.
//
// A camera's time shift and the motion enter the images as a product. While both are vague, in a
// quick turn, a linear filter becomes sure of wrong velocities and biases, and takes wrong
// branches. So what came in since the start is kept for some seconds and lived through again from
// several guesses of the shift: the configured one, held; the same, free; the shift that the free
// one found, until it moves no more; and others when all of these explain the images badly. The one
// that explains them best goes on (an iterated filter over the start, from many beginnings).
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimation/filter/filter_rules.hpp"
#include "estimation/world/world_filter.hpp"

namespace fiducap::world {

namespace {
// When the start is looked at, after the first tag.
constexpr std::array kLooks_s{2.0, 4.0, 6.0};
// … and besides, when its images contradict each other.
constexpr std::size_t kMostStrainedLooks = 5;
// A shift is found again from where it was found last, at most so often and while it moves by more
// than this.
constexpr int kMostRefinements = 3;
constexpr double kFarOff_s = 0.003;
constexpr double kSure_sigma = 3.0;
// No shift is believed that the prior calls impossible.
constexpr double kMost_sigma = 6.0;
// Less than this does not tell two lives apart.
constexpr double kClearlyBetter = 10.0;
// Cost per number of a life that explains its images badly: 1 is expected, covered corners make
// it 1.2, and few numbers scatter.
constexpr double kPoorCost = 1.25;
constexpr double kPoorScatter = 4.0;
// Then the shift is searched from so many sigmas of the prior below to so many above.
constexpr int kSearched_sigma = 4;
constexpr double kFoundSpread_sigma = 0.5;
// No search when so many in a row did not help: no clock is to blame then (but sizes or lens, say).
constexpr int kMostVainSearches = 6;
// Nor with so many sightings that living through them a dozen times would take seconds.
constexpr double kMostSearchedNumbers = 8 * 1200.0;
// A sighting that nothing explains yet costs a little more than one that is explained well.
constexpr double kNumbers = 8.0;
constexpr double kUnexplained = 10.0;
}  // namespace

void WorldFilter::look_at(const TagObservations& seen) {
  state_.clocks[static_cast<std::size_t>(seen.camera)].applied_s = to_seconds(seen.clock_shift);
}

ClockEstimate WorldFilter::clock(int camera) const {
  const CameraClock& clock = state_.clocks[static_cast<std::size_t>(camera)];
  const int at = layout::clock(camera);
  return {clock.shift_s, std::sqrt(state_.P()(at, at)), clock.readout_s,
          std::sqrt(state_.P()(at + 1, at + 1))};
}

void WorldFilter::reopen_clock(int camera) {
  open_clock(camera, sensors_.cameras[static_cast<std::size_t>(camera)].time_shift_sigma_s);
  scores_.clear();       // the clock is wrong, not they
  memory_.forget_all();  // its states still believe in the clock
}

void WorldFilter::open_clock(int camera, double sigma_s) {
  if (!config_.estimate_clocks || !has_imu()) return;
  const int at = layout::clock(camera);
  auto P = state_.P();
  P.row(at).setZero();
  P.col(at).setZero();
  P(at, at) = sigma_s * sigma_s;
}

void WorldFilter::begin_log() {
  start_log_ = StartLog{};
  const auto is_known = [](const CameraMount& mount) { return !(mount.time_shift_sigma_s > 0); };
  const bool all_known = std::all_of(sensors_.cameras.begin(), sensors_.cameras.end(), is_known);
  if (!has_imu() || !config_.estimate_clocks || all_known) start_log_.close();
  due_looks_ = 0;
  strained_looks_ = 0;
  life_ = first_guess(1.0);
}

void WorldFilter::log_start(const TagObservations& seen, std::span<const KnownTag> known) {
  if (due_looks_ == kLooks_s.size()) start_log_.close();
  if (start_log_.is_open()) {
    start_log_.add(seen, known);
    // Images without readings lead to no look: a body that has not started begins once more.
    if (start_log_.is_full()) mode_ == Mode::kStarting ? begin_log() : start_log_.close();
    return;
  }
  if (life_.spread > 0) return;
  for (int camera = 0; camera < state_.cameras(); ++camera) reopen_clock(camera);
  life_.spread = 1.0;
}

StartLife WorldFilter::first_guess(double spread) const {
  StartLife life;
  life.spread = spread;
  for (std::size_t k = 0; k < sensors_.cameras.size(); ++k)
    life.shifts_s.push_back(first_shift_of(k));
  return life;
}

/// As configured or stored.
double WorldFilter::first_shift_of(std::size_t camera) const {
  return camera < sensors_.start_shifts_s.size() ? sensors_.start_shifts_s[camera] : 0.0;
}

void WorldFilter::charge(const TagObservations& seen, const UpdateReport& report) {
  if (!reliving_) return;
  const int unexplained = report.tags_seen - report.tags_used - report.tags_rejected;
  life_.cost += report.nis + gate_ * report.tags_rejected + kUnexplained * unexplained;
  life_.numbers += kNumbers * report.tags_seen;
  // Who calls his corners noisy has small distances: the likelihood's other term.
  const CornerNoise& noise = corner_noise_[static_cast<std::size_t>(seen.camera)];
  for (const TagObservation& tag : seen.tags)
    life_.cost += 2.0 * kNumbers * std::log(noise.growth(tag));
}

UpdateReport WorldFilter::relive_start_if_due(const UpdateReport& report, const Axes& before) {
  if (!start_log_.is_open() || due_looks_ == kLooks_s.size() || mode_ != Mode::kRunning)
    return report;
  const bool due = start_log_.seconds_since_first_tag(report.exposed_at) >= kLooks_s[due_looks_];
  const bool strained = strained_updates_ == filter_rules::kStrainedToReopenClock &&
                        strained_looks_ < kMostStrainedLooks;
  if (!due && !strained) return report;
  ++(due ? due_looks_ : strained_looks_);
  return live_best_start(report, before);
}

UpdateReport WorldFilter::live_best_start(const UpdateReport& report, const Axes& before) {
  const Pose X_WB_before = state_.X_WB;
  StartLife present = first_guess(kFoundSpread_sigma);
  for (int camera = 0; camera < state_.cameras(); ++camera)
    present.shifts_s[static_cast<std::size_t>(camera)] = clock(camera).shift_s;
  const bool has_moved = clock_was_far_off(first_guess(0.0));
  StartLife best = first_guess(1.0);
  best.cost = std::numeric_limits<double>::infinity();
  UpdateReport last = live_refined(first_guess(1.0), best, report);
  if (has_moved) last = live_refined(present, best, last);
  last = live_start(first_guess(0.0), last);
  if (life_.cost < best.cost + kClearlyBetter) best = life_;
  const bool is_poor =
      best.cost > kPoorCost * best.numbers + kPoorScatter * std::sqrt(best.numbers);
  if (!is_poor) vain_searches_ = 0;
  if (is_poor && vain_searches_ < kMostVainSearches && best.numbers < kMostSearchedNumbers) {
    ++vain_searches_;
    last = live_refined(search_shift(last), best, last);
  }
  if (best.shifts_s != life_.shifts_s || best.spread != life_.spread) last = live_start(best, last);
  // Poses given out before this image stand in the axes of then. The same tag defines the same
  // axes.
  last.gauge_shift.reset();
  if (!before.are_anchored || before.gauge_tag != gauge_tag_) {
    const Pose relived = state_.X_WB * X_WB_before.inverse();
    last.gauge_shift = relived * report.gauge_shift.value_or(Pose{});
  }
  return last;
}

UpdateReport WorldFilter::live_refined(StartLife guess, StartLife& best,
                                       const UpdateReport& report) {
  UpdateReport last = report;
  bool is_best = false;
  for (int k = 0; k <= kMostRefinements; ++k) {
    last = live_start(guess, last);
    // Another shift must be clearly better; the same one refined, as good: it began nearer to where
    // it ended.
    is_best = life_.cost < best.cost + (is_best ? kClearlyBetter : -kClearlyBetter);
    if (is_best) best = life_;
    if (!clock_was_far_off(life_)) break;
    for (int camera = 0; camera < state_.cameras(); ++camera)
      guess.shifts_s[static_cast<std::size_t>(camera)] = clock(camera).shift_s;
  }
  return last;
}

// All cameras by the same number of sigmas: they hang on one computer more often than not.
StartLife WorldFilter::search_shift(const UpdateReport& report) {
  const auto guess_at = [&](double sigmas, double spread) {
    StartLife guess = first_guess(spread);
    for (std::size_t k = 0; k < guess.shifts_s.size(); ++k)
      guess.shifts_s[k] += sigmas * sensors_.cameras[k].time_shift_sigma_s;
    return guess;
  };
  const auto cost_at = [&](double sigmas) {
    live_start(guess_at(sigmas, 0.0), report);
    return life_.cost;
  };
  double lowest = 0;
  double lowest_cost = std::numeric_limits<double>::infinity();
  for (int sigmas = -kSearched_sigma; sigmas <= kSearched_sigma; ++sigmas) {
    const double cost = cost_at(sigmas);
    if (cost < lowest_cost) lowest = sigmas;
    lowest_cost = std::min(cost, lowest_cost);
  }
  // The parabola through the lowest and its neighbours says where it is lower still.
  const auto vertex = [&](double step) {
    const double below = cost_at(lowest - step);
    const double above = cost_at(lowest + step);
    const double bend = below - 2.0 * lowest_cost + above;
    return bend > 0 ? lowest + std::clamp(0.5 * (below - above) / bend, -1.0, 1.0) * step : lowest;
  };
  lowest = vertex(0.5);
  lowest_cost = cost_at(lowest);
  return guess_at(vertex(0.25), kFoundSpread_sigma);
}

double WorldFilter::cost_of_shifts() const {
  double cost = 0;
  for (int camera = 0; camera < state_.cameras(); ++camera) {
    const auto k = static_cast<std::size_t>(camera);
    if (!(sensors_.cameras[k].time_shift_sigma_s > 0)) continue;  // known exactly
    const double sigmas =
        (state_.clocks[k].shift_s - first_shift_of(k)) / sensors_.cameras[k].time_shift_sigma_s;
    cost += sigmas * sigmas;
  }
  return cost;
}

bool WorldFilter::clock_was_far_off(const StartLife& guess) const {
  for (int camera = 0; camera < state_.cameras(); ++camera) {
    const auto k = static_cast<std::size_t>(camera);
    const ClockEstimate now = clock(camera);
    const double moved_s = std::abs(now.shift_s - guess.shifts_s[k]);
    const bool possible = std::abs(now.shift_s - first_shift_of(k)) <
                          kMost_sigma * sensors_.cameras[k].time_shift_sigma_s;
    if (possible && moved_s > std::max(kFarOff_s, kSure_sigma * now.shift_sigma_s)) return true;
  }
  return false;
}

UpdateReport WorldFilter::live_start(const StartLife& guess, const UpdateReport& report) {
  life_ = guess;
  life_.cost = life_.numbers = 0;
  StartLog log = std::move(start_log_);
  start_log_.close();
  reliving_ = true;
  restart();
  imu_.forget_all();
  corner_noise_.assign(corner_noise_.size(), CornerNoise(config_, config_.learn_corner_noise));
  log.shift_images(life_.shifts_s);
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
  life_.cost += cost_of_shifts();
  reliving_ = false;
  start_log_ = std::move(log);
  return last;
}

}  // namespace fiducap::world
