#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fiducap/client.hpp"

/// What happens at a Fiducap server that a person should know: bodies lost and found, devices gone,
/// disks full, clocks unsynchronised. Needs no token.
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
  std::uint16_t port{21600};        ///< The same number as for poses, TCP.
  bool history{true};               ///< First what the server still knows, at most 256 events.
};

/// The events of one server, one after the other. Connects when first asked and again after the
/// connection broke; what happened meanwhile is not lost. Not thread-safe.
class FIDUCAP_CLIENT_API EventWatch {
 public:
  explicit EventWatch(EventOptions options);
  ~EventWatch();
  EventWatch(const EventWatch&) = delete;
  EventWatch& operator=(const EventWatch&) = delete;

  /// Waits for the next event; to connect may take half a second longer.
  /// @return false: none within `patience`, see `problem`
  bool next(ServerEvent& event, std::chrono::milliseconds patience);
  /// What holds now, as the server said last: conditions that have begun and not ended.
  const std::vector<ServerEvent>& standing() const;
  /// Why there is no connection, in one sentence; empty: there is one.
  const std::string& problem() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
