#include "tools/plot/plot_axis.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "base/text.hpp"

namespace fiducap {
namespace {

constexpr double kRounding = 1e-9;  // of a step: what only floating point makes of a whole number
constexpr int kMostDecades = 12;    // with more of them only every few are labelled

/// Steps of 1, 2 or 5 times a power of ten, about `ticks` of them.
double step_for(double span, int ticks) {
  const double rough = span / std::max(1, ticks);
  const double decade = std::pow(10, std::floor(std::log10(rough)));
  for (const double k : {1.0, 2.0, 5.0})
    if (k * decade >= rough * (1 - kRounding)) return k * decade;
  return 10 * decade;
}

std::string tick_text(double value, double step) {
  if (std::abs(value) < kRounding * step) return "0";  // no "-0"
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + kRounding)));
  if (decimals <= 6 && std::abs(value) < 1e7) return fixed(value, decimals);
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

std::string power_text(int exponent) {
  constexpr std::array<const char*, 10> kRaised{"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = exponent < 0 ? "10⁻" : "10";
  for (const char digit : std::to_string(std::abs(exponent)))
    text += kRaised[static_cast<std::size_t>(digit - '0')];
  return text;
}

}  // namespace

bool PlotAxis::can_show(double value) const {
  return std::isfinite(value) && (scale_ == Scale::kLinear || value > 0);
}

void PlotAxis::add(double value) {
  if (!can_show(value)) return;
  low_ = std::min(low_, value);
  high_ = std::max(high_, value);
}

void PlotAxis::finish(int ticks, Ends ends) {
  if (scale_ == Scale::kLogarithmic) return finish_decades(ends);
  if (!(low_ <= high_)) low_ = 0, high_ = 1;
  // Less than this of numbers so large is nothing but their rounding.
  const double least = std::max(1e-12, 1e-9 * std::max(std::abs(low_), std::abs(high_)));
  if (high_ - low_ < least) {
    const double half = std::max(1e-3, 0.05 * std::abs(low_));
    low_ -= half;
    high_ += half;
  }
  step_ = step_for(high_ - low_, ticks);
  if (ends == Ends::kAsGiven) return;
  low_ = step_ * std::floor(low_ / step_ + kRounding);
  high_ = step_ * std::ceil(high_ / step_ - kRounding);
}

void PlotAxis::finish_decades(Ends ends) {
  if (!(low_ <= high_)) low_ = 1, high_ = 10;
  if (ends == Ends::kRound || high_ < low_ * (1 + kRounding)) {
    const double first = std::floor(std::log10(low_) + kRounding);
    low_ = std::pow(10, first);
    high_ = std::pow(10, std::max(std::ceil(std::log10(high_) - kRounding), first + 1));
  }
}

void PlotAxis::span(double low, double high, int ticks) {
  low_ = low;
  high_ = high;
  if (scale_ == Scale::kLinear) step_ = step_for(high - low, ticks);
}

double PlotAxis::share(double value) const {
  if (scale_ == Scale::kLinear) return (value - low_) / (high_ - low_);
  return std::log(value / low_) / std::log(high_ / low_);
}

std::vector<PlotTick> PlotAxis::ticks() const {
  std::vector<PlotTick> ticks;
  if (scale_ == Scale::kLinear) {
    const double first = std::ceil(low_ / step_ - kRounding);
    const double last = std::floor(high_ / step_ + kRounding);
    for (double k = first; k <= last; ++k)
      ticks.push_back({k * step_, tick_text(k * step_, step_)});
    return ticks;
  }
  const int first = static_cast<int>(std::floor(std::log10(low_) + kRounding));
  const int last = static_cast<int>(std::ceil(std::log10(high_) - kRounding));
  const int every = 1 + (last - first) / kMostDecades;
  const auto in_range = [&](double value) {
    return value >= low_ * (1 - kRounding) && value <= high_ * (1 + kRounding);
  };
  for (int e = first; e <= last; ++e) {
    const double decade = std::pow(10.0, e);
    if (in_range(decade)) ticks.push_back({decade, (e - first) % every == 0 ? power_text(e) : ""});
    for (int k = 2; k < 10 && every == 1; ++k)
      if (in_range(k * decade)) ticks.push_back({k * decade, ""});
  }
  return ticks;
}

}  // namespace fiducap
