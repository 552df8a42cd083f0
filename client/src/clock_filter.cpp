#include "src/clock_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fiducap::sdk {

namespace {

// Time for which the drift is assumed to be constant.
constexpr double kWindow_s = 32.0;
// Two crystals of ordinary computers, 1-sigma; and the limit with a time daemon.
constexpr double kDriftSigma = 100e-6;
constexpr double kMostDrift = 1000e-6;
// Least jitter, by scheduling and reading of clocks.
constexpr double kLeastJitter_s = 2e-6;
// Least number of samples for an estimate.
constexpr std::size_t kLeastSamples = 4;
// A sample this far on the impossible side means that a clock was set.
constexpr double kContradictionSigmas = 6.0;
constexpr double kLeastContradiction_s = 200e-6;

double to_s(Nanoseconds span) { return static_cast<double>(span) * 1e-9; }

}  // namespace

void ClockFilter::reset() { *this = ClockFilter(); }

void ClockFilter::add(const ClockSample& sample) {
  const Nanoseconds away = sample.returned - sample.asked;
  const Nanoseconds there = sample.answered - sample.received;
  if (away < 0 || there < 0 || there > away) return;
  if (count_ == 0) {
    origin_ = sample.asked;
    base_ = sample.received - sample.asked;
  }
  const Nanoseconds middle = sample.asked + away / 2;
  const Sample taken{to_s(middle - origin_), to_s(sample.received - sample.asked - base_),
                     to_s(sample.answered - sample.returned - base_)};
  if (count_ >= kLeastSamples && contradicts(taken, middle)) {
    reset();
    return add(sample);
  }
  keep(taken);
  fit();
  if (edges_.upper_s <
      edges_.lower_s - kLeastContradiction_s) {  // no line fits between the edges: a clock was set
    reset();
    add(sample);
  }
}

void ClockFilter::keep(const Sample& sample) {
  samples_[next_] = sample;
  next_ = (next_ + 1) % kKept;
  count_ = std::min(count_ + 1, kKept);
  const double oldest_s = sample.at_s - kWindow_s;
  // The order does not matter: an old sample is replaced by the last of the array.
  const auto end =
      std::remove_if(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(count_),
                     [&](const Sample& s) { return s.at_s < oldest_s; });
  const auto left = static_cast<std::size_t>(end - samples_.begin());
  if (left == count_) return;
  count_ = left;
  next_ = left;
}

bool ClockFilter::contradicts(const Sample& sample, Nanoseconds own_time) const {
  const ClockEstimate estimate = at(own_time);
  const double offset_s = to_s(estimate.offset - base_);
  const double slack_s = std::max(kLeastContradiction_s, kContradictionSigmas * estimate.sigma_s);
  return sample.upper_s < offset_s - slack_s || sample.lower_s > offset_s + slack_s;
}

ClockFilter::Edges ClockFilter::edges(double drift) const {
  Edges found{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i < count_; ++i) {
    const double moved_s = drift * (samples_[i].at_s - mean_at_s_);
    found.upper_s = std::min(found.upper_s, samples_[i].upper_s - moved_s);
    found.lower_s = std::max(found.lower_s, samples_[i].lower_s - moved_s);
  }
  return found;
}

double ClockFilter::log_probability(double drift) const {
  const Edges found = edges(drift);
  const auto n = static_cast<double>(count_);
  return n * (found.upper_s / upper_jitter_s_ - found.lower_s / lower_jitter_s_) -
         0.5 * drift * drift / (kDriftSigma * kDriftSigma);
}

void ClockFilter::fit() {
  const auto n = static_cast<double>(count_);
  double sum_at_s = 0;
  double first_s = std::numeric_limits<double>::infinity();
  double last_s = -first_s;
  for (std::size_t i = 0; i < count_; ++i) {
    sum_at_s += samples_[i].at_s;
    first_s = std::min(first_s, samples_[i].at_s);
    last_s = std::max(last_s, samples_[i].at_s);
  }
  mean_at_s_ = sum_at_s / n;
  span_s_ = last_s - first_s;
  // The mean excess hardly depends on the slope: the newest slope is used.
  const Edges before = edges(drift_);
  // From the median, which is robust: for an exponential waiting time it is ln 2 of the mean.
  std::array<double, kKept> excess{};
  const auto middle_of = [&](auto&& excess_of) {
    for (std::size_t i = 0; i < count_; ++i)
      excess[i] = excess_of(samples_[i], drift_ * (samples_[i].at_s - mean_at_s_));
    const auto middle = excess.begin() + static_cast<std::ptrdiff_t>(count_ / 2);
    std::nth_element(excess.begin(), middle, excess.begin() + static_cast<std::ptrdiff_t>(count_));
    return std::max(kLeastJitter_s, *middle / M_LN2);
  };
  upper_jitter_s_ = middle_of(
      [&](const Sample& s, double moved_s) { return s.upper_s - moved_s - before.upper_s; });
  lower_jitter_s_ = middle_of(
      [&](const Sample& s, double moved_s) { return before.lower_s - s.lower_s + moved_s; });
  drift_ = most_probable_drift();
  edges_ = edges(drift_);
}

double ClockFilter::most_probable_drift() const {
  // Concave in the drift: golden section.
  constexpr double kGolden = 0.6180339887498949;
  double low = -kMostDrift;
  double high = kMostDrift;
  double left = high - kGolden * (high - low);
  double right = low + kGolden * (high - low);
  double at_left = log_probability(left);
  double at_right = log_probability(right);
  while (high - low > 1e-8) {  // 0.01 ppm
    if (at_left > at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - kGolden * (high - low);
      at_left = log_probability(left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + kGolden * (high - low);
      at_right = log_probability(right);
    }
  }
  return 0.5 * (low + high);
}

ClockEstimate ClockFilter::at(Nanoseconds own_time) const {
  ClockEstimate estimate;
  estimate.samples = static_cast<int>(count_);
  if (count_ < kLeastSamples) return estimate;
  const auto n = static_cast<double>(count_);
  const double since_mean_s = to_s(own_time - origin_) - mean_at_s_;
  const double offset_s = 0.5 * (edges_.upper_s + edges_.lower_s) + drift_ * since_mean_s;
  // Minimum of n waiting times with a flat density at zero: mean and spread 2 jitter / n, half of
  // it from each direction.
  const double edge_sigma_s = std::hypot(upper_jitter_s_, lower_jitter_s_) / n;
  // The slope follows from the edges of the earlier and the later half, half a span apart.
  const double slope_sigma = 4.0 * edge_sigma_s / std::max(1e-3, 0.5 * span_s_);
  const double drift_sigma = slope_sigma * kDriftSigma / std::hypot(slope_sigma, kDriftSigma);
  estimate.known = true;
  estimate.offset = base_ + static_cast<Nanoseconds>(std::llround(offset_s * 1e9));
  estimate.drift = drift_;
  estimate.sigma_s = std::hypot(edge_sigma_s, drift_sigma * since_mean_s);
  estimate.round_trip_s = std::max(0.0, edges_.upper_s - edges_.lower_s);
  estimate.bound_s = 0.5 * estimate.round_trip_s + drift_sigma * std::abs(since_mean_s);
  return estimate;
}

}  // namespace fiducap::sdk
