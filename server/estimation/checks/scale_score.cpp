#include "estimation/checks/scale_score.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

// Of a median against a mean, white noise.
constexpr double kMedianLoss = 1.2533;
constexpr double kSameSide = 0.02;
// A look this many sigma off counts no more than one that is so far off.
constexpr double kHuber = 3.0;

}  // namespace

void ScaleScore::add(const LogScale& look) {
  looks_[next_] = look;
  next_ = (next_ + 1) % kMost;
  count_ = std::min(count_ + 1, kMost);
}

std::optional<LogScale> ScaleScore::guess() const {
  if (count_ == 0) return std::nullopt;
  std::array<LogScale, kMost> sorted = looks_;
  const auto end = sorted.begin() + static_cast<std::ptrdiff_t>(count_);
  std::sort(sorted.begin(), end,
            [](const LogScale& a, const LogScale& b) { return a.value < b.value; });
  double total = 0;
  for (auto look = sorted.begin(); look != end; ++look) total += weight_of(*look);
  auto middle = sorted.begin();
  for (double sum = weight_of(*middle); sum < total / 2; sum += weight_of(*middle)) ++middle;
  double scatter = 0;
  for (auto look = sorted.begin(); look != end; ++look) {
    const double off =
        std::min(kHuber * kHuber,
                 (look->value - middle->value) * (look->value - middle->value) * weight_of(*look));
    scatter += off / static_cast<double>(std::max<std::size_t>(1, count_ - 1));
  }
  return LogScale{middle->value, kMedianLoss * std::sqrt(std::max(1.0, scatter) / total)};
}

double ScaleScore::agreement(double value) const {
  double total = 0;
  double same = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    total += weight_of(looks_[i]);
    if (value > 0 ? looks_[i].value > kSameSide : looks_[i].value < -kSameSide)
      same += weight_of(looks_[i]);
  }
  return total > 0 ? same / total : 0.0;
}

}  // namespace fiducap
