#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>

#include <fmt/format.h>

#include "base/text.hpp"
#include "tools/replay/run_files.hpp"

namespace fiducap {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kMaxSeconds = 9'000'000'000;  // what int64 nanoseconds can hold

std::string seconds_text(Instant at) {
  const std::int64_t ns = to_ns(at);
  const std::uint64_t magnitude =
      ns < 0 ? 0 - static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
  return fmt::format("{}{}.{:09}", ns < 0 ? "-" : "", magnitude / kNsPerSecond,
                     magnitude % kNsPerSecond);
}

/// Digits only, no double in between; digits beyond the nanosecond are cut.
std::optional<Instant> parse_seconds(std::string_view word) {
  std::int64_t seconds = 0;
  const char* const end = word.data() + word.size();
  const auto whole = std::from_chars(word.data(), end, seconds);
  if (whole.ec != std::errc{} || seconds < 0 || seconds > kMaxSeconds) return std::nullopt;
  std::int64_t ns = 0;
  const char* at = whole.ptr;
  if (at != end) {
    if (*at++ != '.') return std::nullopt;
    std::int64_t scale = kNsPerSecond;
    for (; at != end; ++at) {
      if (*at < '0' || *at > '9') return std::nullopt;
      scale /= 10;
      ns += scale * (*at - '0');
    }
  }
  return instant_from_ns(seconds * kNsPerSecond + ns);
}

std::string_view next_word(std::string_view& line) {
  const auto begin = line.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return line = {};
  line.remove_prefix(begin);
  const std::string_view word = line.substr(0, line.find_first_of(" \t\r"));
  line.remove_prefix(word.size());
  return word;
}

/// One value per line; comments and empty lines are skipped.
/// @param expected  content of a line, for the error; @param hint  at the end of the error
template <typename Stamped>
Expected<std::vector<Stamped>> read_lines(std::string_view text, const std::string& context,
                                          std::optional<Stamped> (*parse)(std::string_view),
                                          const std::string& expected, const char* hint = "") {
  std::vector<Stamped> all;
  for (int number = 1; !text.empty(); ++number) {
    const auto end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    std::string_view rest = line;
    const std::string_view first = next_word(rest);
    if (first.empty() || first.front() == '#') continue;
    const auto one = parse(line);
    const std::string where = context + ":" + std::to_string(number);
    if (!one)
      return fail(ErrorCode::kInvalid,
                  "expected " + expected + ", got '" + std::string(line.substr(0, 80)) + "'" + hint,
                  where);
    if (!all.empty() && one->at <= all.back().at)
      return fail(ErrorCode::kInvalid, "time does not increase", where);
    all.push_back(*one);
  }
  return all;
}

std::optional<StampedPose> pose_of(std::string_view line) {
  const auto at = parse_seconds(next_word(line));
  std::array<double, 7> v{};
  for (double& value : v)
    if (!parse_number(next_word(line), value) || !std::isfinite(value)) return std::nullopt;
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  const bool unit = std::abs(q.norm() - 1) < 1e-3;
  if (!at || !unit || !next_word(line).empty()) return std::nullopt;
  return StampedPose{*at, {q.normalized(), {v[0], v[1], v[2]}}};
}

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

std::string to_tum(std::span<const StampedPose> poses) {
  std::string text;
  for (const auto& [at, X_WB] : poses) {
    text += seconds_text(at);
    for (const double value :
         {X_WB.p.x(), X_WB.p.y(), X_WB.p.z(), X_WB.q.x(), X_WB.q.y(), X_WB.q.z(), X_WB.q.w()})
      text += ' ' + shortest(value);
    text += '\n';
  }
  return text;
}

Expected<std::vector<StampedPose>> tum_from(std::string_view text, const std::string& context) {
  return read_lines(text, context, pose_of, "'t tx ty tz qx qy qz qw' with a unit quaternion");
}

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
  return read_lines(text, context, covariance_of, "nanoseconds and 21 numbers of a covariance",
                    "; replay again");
}

}  // namespace fiducap
