#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "fiducap/client.hpp"
#include "fiducap/events.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

inline constexpr std::uint16_t kNativePort = 21600;

/// Whether `limit_s` seconds have passed since `start`; 0: there is no limit.
[[nodiscard]] bool is_over(std::chrono::steady_clock::time_point start, double limit_s);

struct ServerAddress {
  std::string host;
  std::uint16_t port{};
};

/// @param text  HOST, HOST:PORT, [IPV6] or [IPV6]:PORT
/// @return Error when there is no host or the port is no number in 1..65535
[[nodiscard]] Expected<ServerAddress> parse_server_address(std::string_view text,
                                                           std::uint16_t default_port);

/// For a client of the SDK that the server lists under `name`.
[[nodiscard]] ClientOptions client_options(const ServerAddress& address, const char* name);

/// Heading line, column names and one line per body; every line ends with a line break.
[[nodiscard]] std::string watch_table(const std::string& server, const Frame& frame,
                                      const ClientStatistics& statistics);
/// One line per body, for logs. @param with_names  those of the columns above them
[[nodiscard]] std::string watch_lines(const Frame& frame, const ClientStatistics& statistics,
                                      bool with_names);
/// One JSON object in one line. Unknown values are null.
/// @param skipped  frames that were received but not printed, so far
[[nodiscard]] std::string watch_json(const Frame& frame, const ClientStatistics& statistics,
                                     std::uint64_t skipped);

/// Every received frame for an output that may be slower for some seconds. When it is full, new
/// frames are skipped, counted. Thread-safe.
class FrameQueue final {
 public:
  static constexpr std::size_t kMost = 4096;

  void push(const Frame& frame);
  /// @return the oldest; nullopt: none came within `timeout`
  [[nodiscard]] std::optional<Frame> pop(std::chrono::milliseconds timeout);
  [[nodiscard]] std::uint64_t skipped() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable came_;
  std::deque<Frame> frames_;
  std::uint64_t skipped_{0};
};

/// `2026-01-31 12:00:00.123 error   drone: lost, … – do this`
[[nodiscard]] std::string event_line(const ServerEvent& event);

}  // namespace fiducap
