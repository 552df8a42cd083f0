#include "tools/replay/covariance_file.hpp"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>

#include "base/text.hpp"

namespace fiducap {
namespace {

/// Takes one number off the beginning of the line.
template <typename Number>
std::optional<Number> take_number(std::string_view& line) {
  Number value{};
  const auto parsed = std::from_chars(line.data(), line.data() + line.size(), value);
  if (parsed.ec != std::errc{}) return std::nullopt;
  line.remove_prefix(static_cast<std::size_t>(parsed.ptr - line.data()));
  return value;
}

std::optional<StampedCovariance> covariance_of(std::string_view line) {
  const auto ns = take_number<std::int64_t>(line);
  if (!ns) return std::nullopt;
  StampedCovariance at{instant_from_ns(*ns), Matrix6d::Zero()};
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) {
      if (line.empty() || line.front() != ',') return std::nullopt;
      line.remove_prefix(1);
      const auto value = take_number<double>(line);
      if (!value || !std::isfinite(*value) || (row == column && *value < 0)) return std::nullopt;
      at.covariance(row, column) = at.covariance(column, row) = *value;
    }
  if (!line.empty()) return std::nullopt;
  return at;
}

}  // namespace

std::string to_covariance_csv(std::span<const StampedCovariance> covariances) {
  std::string text = "#t_ns";
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      text += ",P" + std::to_string(row) + std::to_string(column);
  text += '\n';
  for (const StampedCovariance& at : covariances) {
    text += std::to_string(to_ns(at.at));
    for (int row = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column)
        text += ',' + shortest(at.covariance(row, column));
    text += '\n';
  }
  return text;
}

Expected<std::vector<StampedCovariance>> covariances_from_csv(std::string_view text,
                                                              const std::string& context) {
  std::vector<StampedCovariance> covariances;
  for (int number = 1; !text.empty(); ++number) {
    const auto end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty() || line.front() == '#') continue;
    const auto covariance = covariance_of(line);
    const std::string where = context + ":" + std::to_string(number);
    if (!covariance)
      return fail(ErrorCode::kInvalid,
                  "expected nanoseconds and 21 numbers of a covariance, got '" +
                      std::string(line.substr(0, 80)) + "'; replay again",
                  where);
    if (!covariances.empty() && covariance->at <= covariances.back().at)
      return fail(ErrorCode::kInvalid, "time does not increase", where);
    covariances.push_back(*covariance);
  }
  return covariances;
}

}  // namespace fiducap
