#include "estimation/start/start_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "estimation/filter/filter_rules.hpp"

namespace fiducap {

namespace {
// When the start is looked at, after the first tag; the last time only for a noisy IMU.
constexpr std::array kLooks_s{2.0, 4.0, 6.0, 12.0};
constexpr std::size_t kUsualLooks = 3;
// An IMU whose noise may yet turn out larger, or did by this factor of its variance since the last
// look.
constexpr double kMayBeNoisy_sigma = 2.0;
constexpr double kNoisier = 1.5;
// 1/σ² of the variance, in units of the declared one: a start of six seconds tells as much of an
// IMU that is as declared.
constexpr double kNoiseKnown = 0.1;
// … and besides, when its images contradict each other.
constexpr std::size_t kMostContradictedLooks = 5;
// No search when so many in a row did not help: no clock is wrong then (but sizes or lens, say).
constexpr int kMostFailedClockSearches = 6;
// Work with each image that comes in, in units of some 15 microseconds: what following a small
// image of the past costs.
constexpr double kWorkPerImage = 800.0;
constexpr double kWorkOfReading = 0.1;
// Noises that were learned with a clock so near are those of this one, too.
constexpr double kSameClock_s = 0.003;

/// An update grows with its tags, and with the tags of the state, of which there are as many at
/// least.
double work_of(const TagObservations& seen) {
  const auto tags = static_cast<double>(seen.tags.size());
  return 1.0 + tags * (1.0 + 0.1 * tags);
}
}  // namespace

StartSearch::StartSearch(HypothesisPlan::Prior prior, bool is_needed, MakeFilter make)
    : prior_(std::move(prior)), is_needed_(is_needed), make_(std::move(make)) {
  begin();
}

void StartSearch::begin() {
  is_open_ = is_needed_;
  log_ = StartLog{};
  due_looks_ = 0;
  contradicted_looks_ = 0;
  next_contradicted_ = 0;
  plan_.reset();
  trial_.reset();
  best_.reset();
  lessons_ = {};
}

void StartSearch::close(StartingFilter& filter) {
  begin();
  is_open_ = false;
  filter.end_start();
}

void StartSearch::add(const ImuSample& imu) {
  if (is_open_) log_.add(imu);
}

std::optional<StartSearch::Start> StartSearch::add(const TagObservations& seen,
                                                   const MapKnowledge& map,
                                                   StartingFilter& present) {
  if (!is_open_) return std::nullopt;
  log_.add(seen, map);
  if (log_.is_full()) {
    // Images without readings lead to no look: a search that has not started begins once more.
    present.is_following() ? close(present) : begin();
    return std::nullopt;
  }
  const bool was_last =
      due_looks_ == kLooks_s.size() || (due_looks_ == kUsualLooks && is_noise_settled(present));
  if (!plan_ && was_last) {
    close(present);
    return std::nullopt;
  }
  if (!plan_ && is_due(seen.exposed_at, present)) begin_plan(present);
  double work = kWorkPerImage;
  while (plan_ && work > 0) {
    if (trial_) {
      advance(*trial_, work);
      if (trial_->images == horizon_) judge_trial();
    } else if (const auto hypothesis = plan_->next()) {
      trial_ = begin_trial(*hypothesis);
    } else if (catch_up(work)) {
      plan_.reset();
      std::optional<Trial> best = std::exchange(best_, std::nullopt);
      return best ? std::optional(std::move(best->start)) : std::nullopt;
    }
  }
  return std::nullopt;
}

bool StartSearch::is_due(Instant now, const StartingFilter& present) {
  if (!present.is_following()) return false;
  const bool is_time = log_.seconds_since_first_tag(now) >= kLooks_s[due_looks_];
  const bool contradicts =
      present.contradicting_images() >= filter_rules::kContradictionsToReopenClock &&
      contradicted_looks_ < kMostContradictedLooks && log_.images().size() >= next_contradicted_;
  if (!is_time && !contradicts) return false;
  ++(is_time ? due_looks_ : contradicted_looks_);
  return true;
}

void StartSearch::begin_plan(const StartingFilter& present) {
  std::vector<ClockEstimate> clocks;
  for (std::size_t k = 0; k < prior_.shifts_s.size(); ++k)
    clocks.push_back(present.clock(static_cast<int>(k)));
  plan_.emplace(prior_, clocks, failed_clock_searches_ < kMostFailedClockSearches);
  horizon_ = log_.images().size();
  lessons_ = present.lessons();
  lessons_clocks_s_.clear();
  for (const ClockEstimate& clock : clocks) lessons_clocks_s_.push_back(clock.shift_s);
}

/// What was placed while a noisy IMU was believed is too sure. Noise that was taken for larger once
/// is known less well from then on.
bool StartSearch::is_noise_settled(const StartingFilter& present) const {
  const LearnedNoise now = present.lessons().sensors;
  return now.imu_information() > kNoiseKnown &&
         now.imu_variance() < kNoisier * lessons_.sensors.imu_variance() &&
         now.imu_score() < kMayBeNoisy_sigma;
}

/// With other clocks than these the images would have looked noisier, or less so, or like those of
/// another lens.
bool StartSearch::is_of_learned_clocks(const ClockHypothesis& hypothesis) const {
  return std::equal(hypothesis.shifts_s.begin(), hypothesis.shifts_s.end(),
                    lessons_clocks_s_.begin(), lessons_clocks_s_.end(),
                    [](double a, double b) { return std::abs(a - b) < kSameClock_s; });
}

StartSearch::Trial StartSearch::begin_trial(const ClockHypothesis& hypothesis) const {
  Trial trial{hypothesis, {make_(hypothesis), witness_ ? witness_->afresh() : nullptr}, {}, 0, 0,
              {}};
  trial.start.filter->begin_with(
      is_of_learned_clocks(hypothesis) ? lessons_ : StartLessons{{}, lessons_.corners_px, {}});
  trial.order.resize(horizon_);
  std::iota(trial.order.begin(), trial.order.end(), std::size_t{0});
  const auto exposed_at = [&](std::size_t i) {
    const TagObservations& seen = log_.images()[i].seen;
    const double shift_s = hypothesis.shifts_s[static_cast<std::size_t>(seen.camera)];
    return seen.exposed_at - seen.clock_shift + from_seconds(shift_s);
  };
  std::stable_sort(trial.order.begin(), trial.order.end(),
                   [&](std::size_t a, std::size_t b) { return exposed_at(a) < exposed_at(b); });
  return trial;
}

void StartSearch::advance(Trial& trial, double& work) const {
  while (trial.images < horizon_ && work > 0) {
    const StartLog::Image& image = log_.images()[trial.order[trial.images]];
    const std::size_t readings = trial.readings;
    take_image(trial, image);
    work -= work_of(image.seen) + kWorkOfReading * static_cast<double>(trial.readings - readings);
  }
}

void StartSearch::take_image(Trial& trial, const StartLog::Image& image) const {
  TagObservations seen = image.seen;
  const Duration shift =
      from_seconds(trial.hypothesis.shifts_s[static_cast<std::size_t>(seen.camera)]);
  seen.exposed_at += shift - seen.clock_shift;
  seen.clock_shift = shift;
  // Up to the first reading at or after the image, as SampleMerger has it.
  bool is_covered = false;
  while (!is_covered && trial.readings < log_.imu().size()) {
    is_covered = log_.imu()[trial.readings].sampled_at >= seen.exposed_at;
    take_reading(trial);
  }
  const auto& [filter, witness] = trial.start;
  UpdateReport report = filter->update(seen, {image.known, image.may_define_workspace});
  trial.explanation += filter->explain(seen, report);
  report.start_is_open = true;
  if (witness) witness->add(seen, *filter, report, {}, image.known);
  ++trial.images;
}

void StartSearch::take_reading(Trial& trial) const {
  const ImuSample& imu = log_.imu()[trial.readings++];
  if (trial.start.witness) trial.start.witness->add(imu);
  trial.start.filter->propagate(imu);
}

void StartSearch::judge_trial() {
  HypothesisPlan::Outcome outcome{trial_->explanation, {}};
  for (std::size_t k = 0; k < prior_.shifts_s.size(); ++k)
    outcome.clocks.push_back(trial_->start.filter->clock(static_cast<int>(k)));
  if (plan_->take(outcome)) best_ = std::move(trial_);
  trial_.reset();
  if (plan_->next()) return;
  if (!plan_->is_poor()) failed_clock_searches_ = 0;
  if (plan_->has_searched()) ++failed_clock_searches_;
  next_contradicted_ =
      log_.images().size() + static_cast<std::size_t>(filter_rules::kContradictionsToReopenClock);
}

bool StartSearch::catch_up(double& work) {
  if (!best_) return true;
  const std::vector<StartLog::Image>& images = log_.images();
  while (best_->images < images.size()) {
    if (work <= 0) return false;
    const StartLog::Image& image = images[best_->images];
    take_image(*best_, image);
    work -= work_of(image.seen);
  }
  while (best_->readings < log_.imu().size()) take_reading(*best_);
  return true;
}

}  // namespace fiducap
