#include "base/log.hpp"

#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>

#include "base/log_lines.hpp"
#include "base/process.hpp"
#include "base/text.hpp"

namespace fiducap::log {

namespace {

constexpr std::size_t kKeptLines = 500;
constexpr std::chrono::seconds kTidyPeriod{1};
// For the last lines at the end of the process.
constexpr std::chrono::milliseconds kFlushAtExit{500};

std::atomic<Level> g_level{Level::kInfo};

// In order of Level.
constexpr std::array<std::string_view, 4> kNames{"debug", "info", "warning", "error"};
constexpr std::array<std::string_view, 4> kColors{"\x1b[36m", "\x1b[32m", "\x1b[33m\x1b[1m",
                                                  "\x1b[31m\x1b[1m"};

/// `12:34:56.789 warning natnet    text`, into `out`, whose capacity is reused.
void compose(const Line& line, bool colored, std::string& out) {
  const std::time_t seconds = line.utc_ms / 1000;
  std::tm local{};
  ::localtime_r(&seconds, &local);
  std::array<char, 32> time{};
  const auto size = std::strftime(time.data(), time.size(), "%H:%M:%S", &local);
  std::snprintf(time.data() + size, time.size() - size, ".%03d ",
                static_cast<int>(line.utc_ms % 1000));
  const auto padded = [&out](std::string_view word, std::size_t width) {
    out += word;
    if (word.size() < width) out.append(width - word.size(), ' ');
  };
  out = time.data();
  if (colored) out += kColors.at(static_cast<std::size_t>(line.level));
  padded(name_of(line.level), 7);
  if (colored) out += "\x1b[m";
  out += ' ';
  padded(line.module, 9);
  out += ' ';
  out += line.text;
  out += '\n';
}

/// Without stdio, for whose locks the end of a process waits.
void write_whole(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(STDERR_FILENO, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EAGAIN) {  // the terminal was made non-blocking
      pollfd terminal{STDERR_FILENO, POLLOUT, 0};
      ::poll(&terminal, 1, -1);
      continue;
    }
    if (n <= 0) return;  // the terminal is gone
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
}

/// Accepts lines from all threads. A separate thread writes them to stderr, which may block forever
/// (a paused pager, a full pipe). Never destroyed: the thread may be blocked at the end.
class Log {
 public:
  static Log& get() {
    static Log* const log = new Log;  // NOLINT: see above
    return *log;
  }

  void write(Level level, std::string_view module, std::string_view text,
             std::string_view subject) {
    const auto now = std::chrono::steady_clock::now();
    const std::lock_guard lock(mutex_);
    start();
    report_dropped(now);
    if (limiter_.allow({std::string(module), std::string(subject)}, level, now))
      keep(level, module, printable(text));
    changed_.notify_one();
  }

  bool flush(std::chrono::milliseconds limit) {
    std::unique_lock lock(mutex_);
    return idle_.wait_for(lock, limit, [&] { return !has_thread_ || is_idle(); });
  }

  std::vector<Line> lines_after(std::uint64_t number) {
    const std::lock_guard lock(mutex_);
    const auto first =
        std::ranges::find_if(kept_, [&](const Line& l) { return l.number > number; });
    return {first, kept_.end()};
  }

 private:
  Log() : is_colored_(::isatty(STDERR_FILENO) == 1) {
    composed_.reserve(4096);
    std::atexit([] { log::flush(kFlushAtExit); });
  }

  /// Called with every line: the system may have no thread to give at first.
  void start() {
    if (has_thread_) return;
    try {
      std::thread([this] {
        name_this_thread("log");
        run();
      }).detach();
      has_thread_ = true;
    } catch (const std::system_error&) {
    }
  }

  void keep(Level level, std::string_view module, std::string text) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const Line line{next_number_++,
                    std::chrono::duration_cast<std::chrono::milliseconds>(now).count(), level,
                    std::string(module), std::move(text)};
    kept_.push_back(line);
    if (kept_.size() > kKeptLines) kept_.pop_front();
    waiting_.push(line);
  }

  void report_dropped(LineLimiter::Time now) {
    for (const auto& [source, level, lines] : limiter_.ended(now))
      keep(level, source.module,
           (source.subject.empty() ? "" : printable(source.subject) + ": ") +
               std::to_string(lines) + " more lines of this kind were dropped");
  }

  [[nodiscard]] bool is_idle() const { return waiting_.empty() && !is_writing_; }

  void run() {
    const sched_param normal{};  // the creating thread may run in real time
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &normal);
    std::unique_lock lock(mutex_);
    for (;;) {
      if (!changed_.wait_for(lock, kTidyPeriod, [&] { return !waiting_.empty(); }))
        report_dropped(std::chrono::steady_clock::now());
      while (!waiting_.empty()) {
        const Line line = waiting_.pop();
        const std::uint64_t dropped = waiting_.take_dropped();
        is_writing_ = true;
        lock.unlock();
        try {
          show(line, dropped);
        } catch (...) {  // no memory: the line is dropped
        }
        lock.lock();
        is_writing_ = false;
      }
      idle_.notify_all();
    }
  }

  void show(const Line& line, std::uint64_t dropped) {
    compose(line, is_colored_, composed_);
    write_whole(composed_);
    if (dropped == 0) return;
    compose({0, line.utc_ms, Level::kWarning, "log",
             "the terminal did not accept " + std::to_string(dropped) + " more lines"},
            is_colored_, composed_);
    write_whole(composed_);
  }

  const bool is_colored_;
  std::string composed_;  ///< Used by the writing thread only.
  std::mutex mutex_;
  std::condition_variable changed_, idle_;
  bool has_thread_{false};
  bool is_writing_{false};
  LineLimiter limiter_;
  LineQueue waiting_;
  std::deque<Line> kept_;
  std::uint64_t next_number_{1};
};

}  // namespace

void write(Level level, std::string_view module, std::string_view text,
           std::string_view subject) noexcept {
  if (level < g_level.load(std::memory_order_relaxed)) return;
  try {
    Log::get().write(level, module, text, subject);
  } catch (...) {  // no memory: the line is dropped
  }
}

void set_level(Level level) { g_level.store(level, std::memory_order_relaxed); }

bool flush(std::chrono::milliseconds limit) { return Log::get().flush(limit); }

std::vector<Line> lines_after(std::uint64_t number) { return Log::get().lines_after(number); }

std::string_view name_of(Level level) { return kNames.at(static_cast<std::size_t>(level)); }

}  // namespace fiducap::log
