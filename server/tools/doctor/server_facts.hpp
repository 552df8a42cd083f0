#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "tools/doctor/network_check.hpp"

namespace fiducap {

// What `fiducap doctor` asks the machine; nullopt and empty mean that it does not say.

struct MachineFacts {
  int cores{};
  std::string governor;               ///< Of the first core's frequency.
  std::optional<long> realtime_most;  ///< Priority that a program started here may take.
  std::optional<long long> receive_buffer_most;
  std::optional<long long> send_buffer_most;
  std::optional<bool> clock_synchronised;
  std::string unit;  ///< systemd's word for fiducapd.service: active, inactive, failed …
};

/// The operator's; not the secret itself.
struct TokenFacts {
  std::size_t length{};
  std::string unreadable;  ///< Why nothing is known of it.
};

/// A fiducapd of this machine.
struct RunningServer {
  int pid{};
  bool urgent{};  ///< One of its threads has real-time priority.
};

struct FolderFacts {
  std::string path;
  bool writable{};
  std::optional<std::uint64_t> free_bytes;
};

struct StoreFacts {
  std::string path;
  bool exists{};
  bool writable{};
  std::optional<std::string> holder;  ///< `process 4711`
  std::string unreadable;             ///< Why nothing is known of its content.
  std::vector<std::string> damage;    ///< One sentence each.
  FolderFacts folder;
};

/// A standing event of the running server.
struct Alarm {
  std::string subject;
  std::string severity;
  std::string text;
  std::string remedy;
};

struct ServerFacts {
  MachineFacts machine;
  TokenFacts token;
  std::vector<RunningServer> servers;
  std::vector<ListeningPort> listening;
  std::optional<StoreFacts> store;  ///< nullopt: the configuration names none.
  FolderFacts recordings;
  std::vector<Alarm> alarms;
};

/// Looks at this machine, and at the page of the server at `host` for its alarms.
[[nodiscard]] ServerFacts gather_facts(const ServerConfig& config, const std::string& host);

/// Standing events in the JSON of /api/v1/state; none when it does not carry them.
[[nodiscard]] std::vector<Alarm> alarms_in(std::string_view state_json);

}  // namespace fiducap
