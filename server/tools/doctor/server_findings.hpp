#pragma once

#include "tools/doctor/finding.hpp"
#include "tools/doctor/server_facts.hpp"

namespace fiducap {

// What facts mean, each with its remedy. Nothing here looks at the machine.

/// Who may listen and who may change things.
[[nodiscard]] Findings exposure_findings(const ServerConfig& config, const ServerFacts& facts,
                                         const std::vector<NetworkInterface>& interfaces);
/// Cores, priorities, buffers, clock, systemd.
[[nodiscard]] Findings machine_findings(const ServerConfig& config, const ServerFacts& facts);
/// The map's store and the recorder's folder.
[[nodiscard]] Findings disk_findings(const ServerConfig& config, const ServerFacts& facts);
/// Ports of the configuration that another program has.
[[nodiscard]] Findings port_findings(const ServerConfig& config, const ServerFacts& facts);
/// What the running server says of itself.
[[nodiscard]] Findings alarm_findings(const ServerFacts& facts);

/// Of all bodies together, in bytes per second, roughly.
[[nodiscard]] double recording_rate(const ServerConfig& config);

}  // namespace fiducap
