#pragma once

#include <chrono>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/log.hpp"

/// What keeps a log from hurting the process that writes it. No threads, no clock.
namespace fiducap::log {

/// Text from outside may not move the cursor or fake a second line: control characters and DEL
/// become `\x1b`, everything else stays, so that UTF-8 does.
[[nodiscard]] std::string printable(std::string_view text);

/// Who says a line, and about whom.
struct LineSource {
  std::string room;
  std::string subject{};
  auto operator<=>(const LineSource&) const = default;
};

/// One source may say `kMost` lines of one level in a window; the rest is counted and said once.
class LineLimiter final {
 public:
  static constexpr std::uint64_t kMost = 50;
  static constexpr std::chrono::seconds kWindow{10};
  using Time = std::chrono::steady_clock::time_point;

  [[nodiscard]] bool allow(const LineSource& source, Level level, Time now);

  struct LeftOut {
    LineSource source;
    Level level{};
    std::uint64_t lines{};
  };
  /// Whose window has ended with lines left out; each is given once. Who is quiet is forgotten.
  [[nodiscard]] std::vector<LeftOut> ended(Time now);
  [[nodiscard]] std::size_t remembered() const { return windows_.size(); }

 private:
  struct Window {
    Time since{};
    std::uint64_t lines{};
  };
  // Rooms are names in our own code, subjects are bodies and parts of the server: there are few.
  std::map<std::pair<LineSource, Level>, Window> windows_;
};

/// Lines on their way to a terminal that may not take them. When it is full the newest is left out:
/// the first lines of a trouble tell its cause.
class LineQueue final {
 public:
  static constexpr std::size_t kMost = 1000;

  void push(Line line);
  /// The oldest. @pre !empty()
  [[nodiscard]] Line pop();
  [[nodiscard]] bool empty() const { return lines_.empty(); }
  /// How many were left out since the last call.
  [[nodiscard]] std::uint64_t take_left_out() { return std::exchange(left_out_, 0); }

 private:
  std::deque<Line> lines_;
  std::uint64_t left_out_{0};
};

}  // namespace fiducap::log
