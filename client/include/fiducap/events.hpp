#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fiducap/client.hpp"

/// Events of a Fiducap server for users: bodies lost and found, devices disconnected, disks full,
/// clocks not synchronised. Needs no token.
namespace fiducap {

enum class EventSeverity { kInfo, kWarning, kError };

struct ServerEvent {
  std::uint64_t number{};    ///< Counts up from 1 for the life of the server.
  std::int64_t at_utc_ms{};  ///< Wall clock of the server, milliseconds since 1970.
  EventSeverity severity{};
  std::string subject;  ///< A body's name, or a part of the server: `map`, `recorder`, `clock`, …
  std::string kind;     ///< One word for programs: `lost`, `overload`, …
  std::string text;     ///< What happened and why.
  std::string remedy;   ///< What to do; empty: nothing.
  bool over{};          ///< A condition of this subject and kind ended here.
};

struct EventOptions {
  std::string server{"127.0.0.1"};  ///< Address or host name.
  std::uint16_t port{21600};        ///< Same number as for poses, TCP.
  bool history{true};               ///< First the events that the server keeps, at most 256.
};

/// Receives the events of one server. Connects at the first call and again after a failure; events
/// in between are not lost. Not thread-safe.
class FIDUCAP_CLIENT_API EventWatch {
 public:
  explicit EventWatch(EventOptions options);
  ~EventWatch();
  EventWatch(const EventWatch&) = delete;
  EventWatch& operator=(const EventWatch&) = delete;

  /// Waits for the next event; connecting may take half a second longer.
  /// @return false: none within `timeout`, see `problem`
  bool next(ServerEvent& event, std::chrono::milliseconds timeout);
  /// Conditions that hold according to the last message of the server.
  const std::vector<ServerEvent>& standing() const;
  /// Cause of a missing connection, in one sentence; empty: connected.
  const std::string& problem() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
