#include "estimation/start/start_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "estimation/filter/filter_rules.hpp"

namespace fiducap {

namespace {
// Repetitions of a hypothesis at its last result.
constexpr int kMostRefinements = 3;
// s, and sigmas of the result: nearer shifts are the same linearisation.
constexpr double kFarOff_s = 0.003;
constexpr double kSure_sigma = 3.0;
// Largest deviation from the prior.
constexpr double kMost_sigma = 6.0;
// Sigma of a found shift, in sigmas of the prior.
constexpr double kFoundSpread = 0.5;
// Smallest difference of -2 log likelihood that distinguishes two hypotheses.
constexpr double kClearlyBetter = 10.0;
// Cost per number of a bad fit: 1 is expected, occluded corners give 1.2; few numbers scatter.
constexpr double kPoorCost = 1.25;
constexpr double kPoorScatter = 4.0;

constexpr Duration kBeforeFirstTag = std::chrono::seconds(1);
constexpr double kLongest_s = 15.0;
constexpr double kLongestWithoutImage_s = 4.0;
// Fifteen seconds at 100 Hz, with ten tags in each image, and of an IMU at 2 kHz: some megabytes.
constexpr std::size_t kMostImages = 1500;
constexpr std::size_t kMostSightings = 10'000;
constexpr std::size_t kMostReadings = 30'000;
// Times of the searches after the first tag; the last one only for a noisy IMU.
constexpr std::array kLooks_s{2.0, 4.0, 6.0, 12.0};
constexpr std::size_t kUsualLooks = 3;
// An IMU whose noise may be larger than applied, or has grown by this factor since the last search.
constexpr double kMayBeNoisy_sigma = 2.0;
constexpr double kNoisier = 1.5;
// 1/σ² of the variance factor: reached in six seconds by an IMU with the configured noise.
constexpr double kNoiseKnown = 0.1;
// Largest number of searches due to contradicting images.
constexpr std::size_t kMostContradictedLooks = 5;
// Work per image, in units of about 15 µs: the cost of processing a small logged image.
constexpr double kWorkPerImage = 800.0;
constexpr double kWorkOfReading = 0.1;
// Clock difference up to which learned noises are valid.
constexpr double kSameClock_s = 0.003;

/// The cost of an update grows with its tags and with those of the state.
double work_of(const TagObservations& seen) {
  const auto tags = static_cast<double>(seen.tags.size());
  return 1.0 + tags * (1.0 + 0.1 * tags);
}
}  // namespace

HypothesisPlan::HypothesisPlan(Prior prior, std::span<const ClockEstimate> present)
    : prior_(std::move(prior)) {
  planned_.push_back({prior_.shifts_s, 1.0});
  if (is_far_off(prior_.shifts_s, present)) {
    planned_.push_back({{}, kFoundSpread});
    for (const ClockEstimate& clock : present) planned_.back().shifts_s.push_back(clock.shift_s);
  }
  planned_.push_back({prior_.shifts_s, 0.0});
}

std::optional<ClockHypothesis> HypothesisPlan::next() const {
  return at_ < planned_.size() ? std::optional(planned_[at_]) : std::nullopt;
}

bool HypothesisPlan::take(const Outcome& outcome) {
  double cost = outcome.explanation.cost;
  for (std::size_t k = 0; k < outcome.clocks.size(); ++k) {
    if (!(prior_.sigmas_s[k] > 0)) continue;  // known exactly
    const double sigmas = (outcome.clocks[k].shift_s - prior_.shifts_s[k]) / prior_.sigmas_s[k];
    cost += sigmas * sigmas;
  }
  ClockHypothesis& tried = planned_[at_];
  const bool is_held = tried.spread == 0;
  // Another shift must be clearly better; the same one refined, or the configured one, as good.
  const bool is_best =
      cost < best_.cost + (is_held || was_best_ ? kClearlyBetter : -kClearlyBetter);
  if (is_best) best_ = {cost, outcome.explanation.numbers};
  was_best_ = is_best;
  if (!is_held && refinements_ < kMostRefinements && is_far_off(tried.shifts_s, outcome.clocks)) {
    ++refinements_;
    for (std::size_t k = 0; k < tried.shifts_s.size(); ++k)
      tried.shifts_s[k] = outcome.clocks[k].shift_s;
    return is_best;
  }
  ++at_;
  refinements_ = 0;
  was_best_ = false;
  return is_best;
}

bool HypothesisPlan::needs_rotations() const {
  return at_ == planned_.size() && !has_rotations_ &&
         best_.cost > kPoorCost * best_.numbers + kPoorScatter * std::sqrt(best_.numbers);
}

void HypothesisPlan::add_rotations(std::vector<double> shifts_s) {
  planned_.push_back({std::move(shifts_s), kFoundSpread});
  has_rotations_ = true;
}

bool HypothesisPlan::is_far_off(std::span<const double> shifts_s,
                                std::span<const ClockEstimate> found) const {
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double moved_s = std::abs(found[k].shift_s - shifts_s[k]);
    const bool is_possible =
        std::abs(found[k].shift_s - prior_.shifts_s[k]) < kMost_sigma * prior_.sigmas_s[k];
    if (is_possible && moved_s > std::max(kFarOff_s, kSure_sigma * found[k].shift_sigma_s))
      return true;
  }
  return false;
}

void StartLog::add(const ImuSample& imu) {
  if (images_.empty() && !imu_.empty() &&
      imu.sampled_at - imu_.front().sampled_at > 2 * kBeforeFirstTag) {
    std::erase_if(imu_, [&](const ImuSample& old) {
      return imu.sampled_at - old.sampled_at > kBeforeFirstTag;
    });
  }
  if (!is_full()) imu_.push_back(imu);
}

void StartLog::add(const TagObservations& seen, const MapKnowledge& map) {
  if (is_full() || (images_.empty() && seen.tags.empty())) return;
  sightings_ += seen.tags.size();
  images_.push_back({seen, {map.tags.begin(), map.tags.end()}, map.may_define_workspace});
}

bool StartLog::is_full() const {
  if (images_.empty()) return imu_.size() >= kMostReadings;
  const Instant image = images_.back().seen.exposed_at;
  const Instant newest = imu_.empty() ? image : std::max(image, imu_.back().sampled_at);
  return seconds_since_first_tag(newest) > kLongest_s ||
         to_seconds(newest - image) > kLongestWithoutImage_s || images_.size() >= kMostImages ||
         sightings_ >= kMostSightings || imu_.size() >= kMostReadings;
}

double StartLog::seconds_since_first_tag(Instant now) const {
  return images_.empty() ? 0.0 : to_seconds(now - images_.front().seen.exposed_at);
}

StartSearch::StartSearch(HypothesisPlan::Prior prior, bool is_needed, MakeFilter make,
                         MeasureClocks measure)
    : prior_(std::move(prior)),
      is_needed_(is_needed),
      make_(std::move(make)),
      measure_(std::move(measure)) {
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
  priors_ = {};
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
    // Without IMU samples no search has begun: restarts the log.
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
  plan_.emplace(prior_, clocks);
  horizon_ = log_.images().size();
  priors_ = present.initialisation_priors();
  priors_shifts_s_.clear();
  for (const ClockEstimate& clock : clocks) priors_shifts_s_.push_back(clock.shift_s);
}

/// Tags initialised with too small an IMU noise are overconfident.
bool StartSearch::is_noise_settled(const StartingFilter& present) const {
  const LearnedNoise now = present.initialisation_priors().sensors;
  return now.imu_information() > kNoiseKnown &&
         now.imu_variance() < kNoisier * priors_.sensors.imu_variance() &&
         now.imu_score() < kMayBeNoisy_sigma;
}

StartSearch::Trial StartSearch::begin_trial(const ClockHypothesis& hypothesis) const {
  Trial trial{
      hypothesis, {make_(hypothesis), observer_ ? observer_->make_new() : nullptr}, {}, 0, 0, {}};
  // Learned noises and lenses are valid only for nearly the same clocks.
  const bool are_learned =
      std::ranges::equal(hypothesis.shifts_s, priors_shifts_s_,
                         [](double a, double b) { return std::abs(a - b) < kSameClock_s; });
  trial.start.filter->begin_with(are_learned ? priors_
                                             : InitialisationPriors{{}, priors_.corners_px, {}});
  trial.order.resize(horizon_);
  std::iota(trial.order.begin(), trial.order.end(), std::size_t{0});
  const auto exposed_at = [&](std::size_t i) {
    const TagObservations& seen = log_.images()[i].seen;
    const double shift_s = hypothesis.shifts_s[static_cast<std::size_t>(seen.camera)];
    return seen.exposed_at - seen.clock_shift + from_seconds(shift_s);
  };
  std::ranges::stable_sort(trial.order, {}, exposed_at);
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
  // Up to the first sample at or after the image, as in SampleMerger.
  bool is_covered = false;
  while (!is_covered && trial.readings < log_.imu().size()) {
    is_covered = log_.imu()[trial.readings].sampled_at >= seen.exposed_at;
    take_reading(trial);
  }
  const auto& [filter, observer] = trial.start;
  UpdateReport report = filter->update(seen, {image.known, image.may_define_workspace});
  trial.explanation += filter->explain(seen, report);
  report.start_is_open = true;
  if (observer) observer->add(seen, *filter, report, {}, image.known);
  ++trial.images;
}

void StartSearch::take_reading(Trial& trial) const {
  const ImuSample& imu = log_.imu()[trial.readings++];
  if (trial.start.observer) trial.start.observer->add(imu);
  trial.start.filter->propagate(imu);
}

void StartSearch::judge_trial() {
  HypothesisPlan::Outcome outcome{trial_->explanation, {}};
  for (std::size_t k = 0; k < prior_.shifts_s.size(); ++k)
    outcome.clocks.push_back(trial_->start.filter->clock(static_cast<int>(k)));
  if (plan_->take(outcome)) best_ = std::move(trial_);
  trial_.reset();
  if (plan_->needs_rotations()) plan_->add_rotations(measure_(log_));
  if (plan_->next()) return;
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
