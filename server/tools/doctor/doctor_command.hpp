#pragma once

#include <string>
#include <vector>

#include "daemon/protocol_servers.hpp"
#include "middleware/network.hpp"
#include "tools/doctor/network_check.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct DoctorArguments {
  std::string config;  ///< Of the server; empty: defaults.
  std::vector<std::string> sets;
  std::string server{"127.0.0.1"};  ///< HOST or HOST:PORT of the native protocol.
  bool json{false};
};

/// `fiducap doctor`: why a client sees nothing, and what is wrong with a server. Looks at the
/// interfaces, at multicast, at the ports that the configuration names, at what clients of each
/// protocol receive, at who may listen and change things, at priorities, buffers, clock and disks,
/// and at the running server's bodies and alarms.
/// @return exit code: failed when something needs a remedy
[[nodiscard]] int run_doctor(const DoctorArguments& arguments, const Terminal& terminal);

/// What is wrong with how a protocol can be reached, one sentence each with its remedy; empty:
/// nothing.
[[nodiscard]] std::vector<std::string> faults_of(const ServedProtocol& protocol,
                                                 const std::vector<ListeningPort>& listening,
                                                 const std::vector<NetworkInterface>& interfaces);
/// The same for a process's membership in DDS: is the interface there, and is anybody in the domain
/// on this machine?
[[nodiscard]] std::vector<std::string> faults_of(const dds::NetworkConfig& network,
                                                 const std::vector<ListeningPort>& listening,
                                                 const std::vector<NetworkInterface>& interfaces);

}  // namespace fiducap
