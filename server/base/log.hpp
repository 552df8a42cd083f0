#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

namespace fiducap::log {

enum class Level { kDebug, kInfo, kWarning, kError };

struct Line {
  std::uint64_t number{};  ///< Counts up from 1 for the life of the process.
  std::int64_t utc_ms{};   ///< Wall clock, milliseconds since 1970.
  Level level{Level::kInfo};
  std::string module{};  ///< That writes it: `capture`, `vrpn`, …
  std::string text{};
};

/// Writes a line to stderr and to the list for the page. Thread-safe, never waits for the terminal,
/// never throws. For rare events only. Control characters are escaped. Lines that come too often
/// (of a module about one subject), or that the terminal does not accept, are counted and dropped.
void write(Level level, std::string_view module, std::string_view text,
           std::string_view subject = {}) noexcept;
inline void debug(std::string_view module, std::string_view text) {
  write(Level::kDebug, module, text);
}
inline void info(std::string_view module, std::string_view text) {
  write(Level::kInfo, module, text);
}
inline void warning(std::string_view module, std::string_view text) {
  write(Level::kWarning, module, text);
}
inline void error(std::string_view module, std::string_view text) {
  write(Level::kError, module, text);
}

/// Drops lines below this level. Default: info.
void set_level(Level level);

/// Waits until the terminal has all lines, at most `limit`. The end of the process does so, too.
/// @return false when the limit was reached
bool flush(std::chrono::milliseconds limit);

/// The newest lines after `number`, oldest first; at most 500 are kept.
[[nodiscard]] std::vector<Line> lines_after(std::uint64_t number);

[[nodiscard]] std::string_view name_of(Level level);

/// Runs `work`, a session, datagram or round. An exception ends here: it is logged.
/// @param whose  after a failure only: subject of the log line, e.g. a peer; empty: no line
/// @return false: `work` has thrown
template <typename Whose, typename Work>
bool guarded(std::string_view module, Whose&& whose, Work&& work) noexcept {
  const auto report = [&](std::string_view what) noexcept {
    try {
      const std::string subject = whose();
      if (!subject.empty()) error(module, subject + ": " + std::string(what));
    } catch (...) {  // no memory for the line
    }
  };
  try {
    work();
    return true;
  } catch (const std::exception& failure) {
    report(failure.what());
  } catch (...) {
    report("unknown failure");
  }
  return false;
}

}  // namespace fiducap::log
