#pragma once

#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

namespace fiducap {

/// Shortest text that reads back as exactly the same number.
[[nodiscard]] inline std::string to_text(double value) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value);
  return {buffer, end.ptr};
}

/// The same, always with a decimal point: what follows YAML 1.1 (ROS, PyYAML) takes `1` for a whole
/// number and `1e-05` for a word.
[[nodiscard]] inline std::string to_point_text(double value) {
  std::string text = to_text(value);
  if (text.find('.') != std::string::npos) return text;
  const auto exponent = text.find('e');
  return text.insert(exponent == std::string::npos ? text.size() : exponent, ".0");
}

/// The whole text as a number; no spaces, no locale, no nan, no inf.
template <typename T>
[[nodiscard]] std::optional<T> number_from(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || text.empty()) return std::nullopt;
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(value)) return std::nullopt;
  }
  return value;
}

}  // namespace fiducap
