#include "tools/replay/tum_file.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>

namespace fiducap {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kMaxSeconds = 9'000'000'000;  // what int64 nanoseconds can hold

std::string seconds_text(Instant at) {
  const std::int64_t ns = to_ns(at);
  const std::uint64_t magnitude =
      ns < 0 ? 0 - static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%s%llu.%09llu", ns < 0 ? "-" : "",
                static_cast<unsigned long long>(magnitude / kNsPerSecond),
                static_cast<unsigned long long>(magnitude % kNsPerSecond));
  return text.data();
}

void append_number(std::string& out, double value) {
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  out += ' ';
  out.append(text.data(), end.ptr);
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

std::optional<StampedPose> parse_line(std::string_view line) {
  const auto at = parse_seconds(next_word(line));
  std::array<double, 7> v{};
  for (double& value : v) {
    const std::string_view word = next_word(line);
    const auto parsed = std::from_chars(word.data(), word.data() + word.size(), value);
    if (parsed.ec != std::errc{} || parsed.ptr != word.data() + word.size() ||
        !std::isfinite(value))
      return std::nullopt;
  }
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  const bool unit = std::abs(q.norm() - 1) < 1e-3;
  if (!at || !unit || !next_word(line).empty()) return std::nullopt;
  return StampedPose{*at, {q.normalized(), {v[0], v[1], v[2]}}};
}

}  // namespace

std::string to_tum(std::span<const StampedPose> poses) {
  std::string text;
  for (const auto& [at, X_WB] : poses) {
    text += seconds_text(at);
    for (const double value :
         {X_WB.p.x(), X_WB.p.y(), X_WB.p.z(), X_WB.q.x(), X_WB.q.y(), X_WB.q.z(), X_WB.q.w()})
      append_number(text, value);
    text += '\n';
  }
  return text;
}

Expected<std::vector<StampedPose>> tum_from(std::string_view text, const std::string& context) {
  std::vector<StampedPose> poses;
  for (int number = 1; !text.empty(); ++number) {
    const auto end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    std::string_view peek = line;
    const std::string_view first = next_word(peek);
    if (first.empty() || first.front() == '#') continue;
    const auto pose = parse_line(line);
    if (!pose)
      return fail(ErrorCode::kInvalid,
                  "expected 't tx ty tz qx qy qz qw' with a unit quaternion, got '" +
                      std::string(line.substr(0, 80)) + "'",
                  context + ":" + std::to_string(number));
    if (!poses.empty() && pose->at <= poses.back().at)
      return fail(ErrorCode::kInvalid, "time does not increase",
                  context + ":" + std::to_string(number));
    poses.push_back(*pose);
  }
  return poses;
}

}  // namespace fiducap
