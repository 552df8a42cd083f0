#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "daemon/config/sockets.hpp"
#include "daemon/review/config_review.hpp"
#include "middleware/net/listening_ports.hpp"
#include "middleware/network.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct DoctorArguments {
  std::string config;  ///< Of the server; empty: defaults.
  std::vector<std::string> sets;
  std::string server{"127.0.0.1"};  ///< HOST or HOST:PORT of the native protocol.
  bool json{false};
};

/// `fiducap doctor`: why a client receives nothing, and what is wrong with a server. Checks the
/// interfaces, multicast, the ports of the configuration, what clients of each protocol receive,
/// access and operator's token, priorities, buffers, clock and disks, and the running server's
/// bodies and conditions.
/// @return exit code: failed when something needs a remedy
[[nodiscard]] int run_doctor(const DoctorArguments& arguments, const Terminal& terminal);

// ---- Facts: asked of the machine. nullopt and empty: not available.

/// One IPv4 address of this machine.
struct NetworkInterface {
  std::string name;
  std::string address;
  bool up{};
  bool loopback{};
  bool multicast{};  ///< Flag of the kernel.
};

[[nodiscard]] std::vector<NetworkInterface> network_interfaces();

/// Sends one datagram to a multicast group through an interface and waits for it to come back.
/// @return nullopt when it came; else why not, in one sentence
[[nodiscard]] std::optional<std::string> multicast_fault(const NetworkInterface& interface);

using net::listening_port_of;
using net::listening_ports;
using net::ListeningPort;
using net::Transport;

/// The body of a reply 200, at most 4 MB. Each wait ends after `timeout`.
/// @param token  for reading; empty: none
[[nodiscard]] Expected<std::string> http_get(const std::string& host, std::uint16_t port,
                                             const std::string& path,
                                             std::chrono::milliseconds timeout,
                                             const std::string& token = {});

struct MachineFacts {
  int cores{};
  std::string governor;               ///< Of the first core's frequency.
  std::optional<long> realtime_most;  ///< Priority that a program started here may take.
  std::optional<long long> receive_buffer_most;
  std::optional<long long> send_buffer_most;
  std::optional<bool> clock_synchronised;
  std::string unit;  ///< systemd's state of fiducapd.service: active, inactive, failed …
};

/// The operator's; not the secret itself.
struct TokenFacts {
  std::size_t length{};
  std::string unreadable;  ///< Why nothing is known of it.
};

/// A fiducapd of this machine.
struct RunningServer {
  int pid{};
  bool realtime{};  ///< One of its threads has real-time priority.
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

enum class Grade { kOk, kWarning, kFault, kNote };

/// What facts mean.
struct Finding {
  Grade grade{Grade::kOk};
  std::string text;
  std::string remedy{};  ///< Of warnings and faults, unless it is part of the text.
};

using Findings = std::vector<Finding>;

struct ServerFacts {
  MachineFacts machine;
  TokenFacts token;
  std::vector<RunningServer> servers;
  std::vector<ListeningPort> listening;
  /// DDS on loopback: programs of this machine with default settings find the running server.
  /// nullopt: not tried.
  std::optional<bool> dds_found;
  std::optional<StoreFacts> store;  ///< nullopt: the configuration names none.
  FolderFacts recordings;
  Findings alarms;  ///< Conditions that the running server reports.
};

/// Asks this machine, and the page of the server at `host` for its alarms.
[[nodiscard]] ServerFacts gather_facts(const ServerConfig& config, const std::string& host);

/// Conditions in the JSON of /api/v1/state; none when it does not carry them.
[[nodiscard]] Findings alarms_in(std::string_view state_json);

// ---- Findings: what facts mean, each with its remedy. Pure functions.

[[nodiscard]] bool is_loopback(const std::string& address);
/// Why a protocol cannot be reached, one sentence each with its remedy; empty: it can.
[[nodiscard]] std::vector<std::string> faults_of(const ServedProtocol& protocol,
                                                 const std::vector<ListeningPort>& listening,
                                                 const std::vector<NetworkInterface>& interfaces);
/// The same for DDS: does the interface exist, does a participant of the domain listen on this
/// machine, and do programs with default settings find the server?
[[nodiscard]] std::vector<std::string> faults_of(const dds::NetworkConfig& network,
                                                 const ServerFacts& facts,
                                                 const std::vector<NetworkInterface>& interfaces);
/// Which machines may listen, and which may change the server.
[[nodiscard]] Findings exposure_findings(const ServerConfig& config, const ServerFacts& facts,
                                         const std::vector<NetworkInterface>& interfaces);
/// Programs of this machine that lose datagrams of any server.
[[nodiscard]] Findings loss_findings(const ServerFacts& facts);
/// Cores, priorities, buffers, clock, systemd.
[[nodiscard]] Findings machine_findings(const ServerConfig& config, const ServerFacts& facts);
/// The map's store and the recorder's folder.
[[nodiscard]] Findings disk_findings(const ServerConfig& config, const ServerFacts& facts);
/// Ports of the configuration that another program has.
[[nodiscard]] Findings port_findings(const ServerConfig& config, const ServerFacts& facts);

/// Of all bodies together, in bytes per second, roughly.
[[nodiscard]] double recording_rate(const ServerConfig& config);

}  // namespace fiducap
