#include "base/log.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <deque>
#include <mutex>

namespace fiducap::log {

namespace {

constexpr std::size_t kKeptLines = 500;

struct Memory {
  std::mutex mutex;
  std::deque<Line> lines;
  std::uint64_t next_number{1};
};

Memory& memory() {
  static Memory m;
  return m;
}

std::atomic<Level> g_level{Level::kInfo};

spdlog::logger& terminal() {
  static const auto logger = [] {
    auto made = spdlog::stderr_color_mt("fiducap");
    made->set_pattern("%H:%M:%S.%e %^%-7l%$ %v");
    made->set_level(spdlog::level::debug);
    return made;
  }();
  return *logger;
}

spdlog::level::level_enum to_spdlog(Level level) {
  switch (level) {
    case Level::kDebug:
      return spdlog::level::debug;
    case Level::kInfo:
      return spdlog::level::info;
    case Level::kWarning:
      return spdlog::level::warn;
    case Level::kError:
      return spdlog::level::err;
  }
  return spdlog::level::info;
}

}  // namespace

void write(Level level, std::string_view room, std::string_view text) {
  if (level < g_level.load(std::memory_order_relaxed)) return;
  terminal().log(to_spdlog(level), "{:<9} {}", room, text);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  auto& m = memory();
  const std::lock_guard lock(m.mutex);
  m.lines.push_back({m.next_number++,
                     std::chrono::duration_cast<std::chrono::milliseconds>(now).count(), level,
                     std::string(room), std::string(text)});
  if (m.lines.size() > kKeptLines) m.lines.pop_front();
}

void set_level(Level level) { g_level.store(level, std::memory_order_relaxed); }

std::vector<Line> lines_after(std::uint64_t number) {
  auto& m = memory();
  const std::lock_guard lock(m.mutex);
  std::vector<Line> newer;
  for (const auto& line : m.lines) {
    if (line.number > number) newer.push_back(line);
  }
  return newer;
}

std::string_view name_of(Level level) {
  switch (level) {
    case Level::kDebug:
      return "debug";
    case Level::kInfo:
      return "info";
    case Level::kWarning:
      return "warning";
    case Level::kError:
      return "error";
  }
  return "info";
}

}  // namespace fiducap::log
