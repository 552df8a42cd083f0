#pragma once

#include <chrono>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/log.hpp"

/// Bounds of the log: lines per time, and lines that wait. No threads, no clock.
namespace fiducap::log {

struct LineSource {
  std::string module;
  std::string subject{};
  auto operator<=>(const LineSource&) const = default;
};

/// Allows one source `kMost` lines of one level per window and counts the dropped ones.
class LineLimiter final {
 public:
  static constexpr std::uint64_t kMost = 50;
  static constexpr std::chrono::seconds kWindow{10};
  using Time = std::chrono::steady_clock::time_point;

  [[nodiscard]] bool allow(const LineSource& source, Level level, Time now) {
    Window& window = windows_.try_emplace({source, level}, Window{now, 0}).first->second;
    // A window with dropped lines stays until `ended` reports it.
    if (now - window.since >= kWindow && window.lines <= kMost) window = {now, 0};
    return ++window.lines <= kMost;
  }

  struct Dropped {
    LineSource source;
    Level level{};
    std::uint64_t lines{};
  };
  /// Sources whose window has ended with dropped lines, each once. Removes windows that have ended.
  [[nodiscard]] std::vector<Dropped> ended(Time now) {
    std::vector<Dropped> out;
    for (auto one = windows_.begin(); one != windows_.end();) {
      const auto& [key, window] = *one;
      const bool is_over = now - window.since >= kWindow;
      if (is_over && window.lines > kMost)
        out.push_back({key.first, key.second, window.lines - kMost});
      one = is_over ? windows_.erase(one) : std::next(one);
    }
    return out;
  }
  [[nodiscard]] std::size_t remembered() const { return windows_.size(); }

 private:
  struct Window {
    Time since{};
    std::uint64_t lines{};
  };
  // Bounded: modules are names in our own code, subjects are bodies and parts of the server.
  std::map<std::pair<LineSource, Level>, Window> windows_;
};

/// Bounded queue of lines for the terminal; drops the newest: the first ones show the cause.
class LineQueue final {
 public:
  static constexpr std::size_t kMost = 1000;

  void push(Line line) {
    if (lines_.size() < kMost) {
      lines_.push_back(std::move(line));
    } else {
      ++dropped_;
    }
  }
  /// Removes the oldest. @pre !empty()
  [[nodiscard]] Line pop() {
    Line line = std::move(lines_.front());
    lines_.pop_front();
    return line;
  }
  [[nodiscard]] bool empty() const { return lines_.empty(); }
  /// Number of lines dropped since the last call.
  [[nodiscard]] std::uint64_t take_dropped() { return std::exchange(dropped_, 0); }

 private:
  std::deque<Line> lines_;
  std::uint64_t dropped_{0};
};

}  // namespace fiducap::log
