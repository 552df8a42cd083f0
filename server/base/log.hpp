#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace fiducap::log {

enum class Level { kDebug, kInfo, kWarning, kError };

/// One line, as the page shows it.
struct Line {
  std::uint64_t number{};  ///< Counts up from 1 for the life of the process.
  std::int64_t utc_ms{};   ///< Wall clock, milliseconds since 1970.
  Level level{Level::kInfo};
  std::string room{};  ///< Who says it: `capture`, `vrpn`, …
  std::string text{};
};

/// Thread-safe, never waits for the terminal, never throws. Rare events only: never call it per
/// sample or per frame. Control characters are escaped; what a room says too often (about one
/// subject) or the terminal does not take is counted, and the count is said.
void write(Level level, std::string_view room, std::string_view text,
           std::string_view subject = {}) noexcept;
inline void debug(std::string_view room, std::string_view text) {
  write(Level::kDebug, room, text);
}
inline void info(std::string_view room, std::string_view text) { write(Level::kInfo, room, text); }
inline void warning(std::string_view room, std::string_view text) {
  write(Level::kWarning, room, text);
}
inline void error(std::string_view room, std::string_view text) {
  write(Level::kError, room, text);
}

/// Lines below this level go nowhere. Default: info.
void set_level(Level level);

/// Waits until the terminal has all lines, at most `limit`; the end of the process does so, too.
/// @return false when it did not take them
bool flush(std::chrono::milliseconds limit);

/// The newest lines after `number`, oldest first, at most 500 are kept.
[[nodiscard]] std::vector<Line> lines_after(std::uint64_t number);

[[nodiscard]] std::string_view name_of(Level level);

}  // namespace fiducap::log
