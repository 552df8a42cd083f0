#pragma once

#include <cmath>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace fiducap {

/// One broken rule of the configuration.
struct ConfigError {
  std::string path;   ///< e.g. `estimator.corner_noise_px`
  std::string value;  ///< as written or as effective
  std::string rule;   ///< e.g. `must be finite and > 0`

  [[nodiscard]] std::string text() const { return path + " = " + value + ": " + rule; }
};

/// Collects every broken rule of one section, so that a user sees all faults at once.
struct Checker {
  std::string prefix;  ///< e.g. `estimator.`
  std::vector<ConfigError> errors{};

  Checker& positive(std::string_view field, double value) {
    return require(std::isfinite(value) && value > 0, field, value, "must be finite and > 0");
  }
  Checker& not_negative(std::string_view field, double value) {
    return require(std::isfinite(value) && value >= 0, field, value, "must be finite and >= 0");
  }
  Checker& within(std::string_view field, double value, double low, double high) {
    std::ostringstream rule;
    rule << "must be in [" << low << ", " << high << "]";
    return require(value >= low && value <= high, field, value, rule.str());
  }
  template <typename T>
  Checker& require(bool holds, std::string_view field, const T& value, std::string rule) {
    if (!holds) {
      std::ostringstream text;
      text << value;
      errors.push_back({prefix + std::string(field), text.str(), std::move(rule)});
    }
    return *this;
  }
};

/// The words that a configuration uses for the values of an enum.
namespace words {

template <typename E>
struct Word {
  std::string_view text;
  E value;
};

}  // namespace words

}  // namespace fiducap
