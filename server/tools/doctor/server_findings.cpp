#include <algorithm>
#include <array>

#include "base/text.hpp"
#include "middleware/net/networks.hpp"
#include "tools/doctor/doctor.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kLongToken = 16;
constexpr long kServerPriority = 10;
constexpr long long kSmallBuffer_bytes = 1 << 20;
constexpr double kLittleRoom_bytes = 1e9;
constexpr double kNoRoom_bytes = 100e6;
constexpr double kShortSession_min = 60;
// Size of a recording, measured on the demo (docs/recordings.md has the formats).
constexpr double kImuRow_bytes = 150;
constexpr double kImu_hz = 200;
constexpr double kCorners_bytes = 1500;  // of an image
constexpr double kPixel_bytes = 0.5;     // PNG of a room
constexpr double kUnknownImage_px = 1280.0 * 720.0;

void good(Findings& all, std::string text) { all.push_back({Grade::kOk, std::move(text)}); }
void warn(Findings& all, std::string text, std::string remedy) {
  all.push_back({Grade::kWarning, std::move(text), std::move(remedy)});
}
void fault(Findings& all, std::string text, std::string remedy) {
  all.push_back({Grade::kFault, std::move(text), std::move(remedy)});
}

bool is_at(const ListeningPort& open, const PortUse& port) {
  return open.port == port.number && (open.transport == Transport::kUdp) == port.udp;
}

/// Whether an address is routed on the internet (RFC 6890 lists the others).
bool is_public(const std::string& address) {
  const auto peer = net::parse_network(address);
  if (!peer) return false;
  static constexpr std::array kPrivate{"0.0.0.0/8",      "10.0.0.0/8",     "100.64.0.0/10",
                                       "127.0.0.0/8",    "169.254.0.0/16", "172.16.0.0/12",
                                       "192.168.0.0/16", "224.0.0.0/3"};
  return std::ranges::none_of(kPrivate, [&](const char* network) {
    const auto known = net::parse_network(network);
    return known && known->contains({peer->address, 0});
  });
}

std::string allowed_clients(const ServerConfig& config, std::string_view protocol) {
  if (protocol != "natnet") return "all machines that reach the port";
  const auto& clients = config.streaming.natnet.clients;
  if (!clients.empty())
    return "this machine and " + comma_list(clients, [](const std::string& one) { return one; });
  std::string text = "machines of the networks that this one is attached to";
  for (const std::string& one : config.streaming.natnet.networks) text += ", " + one;
  return text;
}

void check_natnet(Findings& all, const natnet::NatNetConfig& natnet) {
  if (!natnet.enabled) return;
  for (const net::Network& one : natnet.trusted_networks()) {
    const bool v4 = one.prefix >= 96;
    if (one.prefix - (v4 ? 96 : 0) < 8)
      fault(
          all,
          "natnet trusts " + net::text_of(one) + ": frames go to any address of it that is forged",
          "name the clients' own networks in streaming.natnet.networks");
  }
  if (!is_loopback(natnet.address) && natnet.clients.empty())
    warn(all,
         "natnet sends frames to each address of the attached networks that asks, also when a "
         "datagram forges it: NatNet proves no address",
         "streaming.natnet.clients: [the clients' addresses]");
  if (natnet.remote_control != RemoteControl::kOff)
    warn(all,
         std::string("natnet clients ") +
             (natnet.remote_control == RemoteControl::kAll ? "" : "of this machine ") +
             "may rename bodies, switch them off and record, without a password",
         "streaming.natnet.remote_control: off, unless a program needs it");
}

/// The checks that `--check-config` reports, too.
void add_checks(Findings& all, const std::vector<ConfigCheck>& checks) {
  for (const ConfigCheck& one : checks)
    all.push_back({one.is_fault ? Grade::kFault : Grade::kWarning, one.text, one.remedy});
}

void check_token(Findings& all, const TokenFacts& token) {
  constexpr const char* kMakeOne =
      "operator.token_file: a file of mode 0600 with the output of `openssl rand -base64 18`";
  if (!token.unreadable.empty())
    warn(all, "the operator's token cannot be read: " + token.unreadable,
         "run doctor as the user that runs fiducapd");
  else if (token.length == 0)
    warn(all,
         "there is no operator's token (one of systemd's credentials is not visible here): no "
         "client may name bodies, freeze the map or record",
         kMakeOne);
  else if (token.length < kLongToken)
    warn(all,
         "the operator's token has " + std::to_string(token.length) +
             " characters and may be guessed",
         kMakeOne);
  else
    good(all, "changes need the operator's token");
}

void check_buffer(Findings& all, const char* name, std::optional<long long> bytes) {
  if (bytes && *bytes < kSmallBuffer_bytes)
    warn(all,
         std::string(name) + " is " + std::to_string(*bytes) +
             ": sockets overflow when many bodies are sent at high rates",
         std::string("`sudo sysctl ") + name + "=8388608`, and a line in /etc/sysctl.d to keep it");
}

void check_priority(Findings& all, const ServerFacts& facts) {
  constexpr const char* kRemedy =
      "LimitRTPRIO=10 in its unit (deploy/fiducapd.service), or `@fiducap - rtprio 10` in "
      "/etc/security/limits.d and a new login";
  for (const RunningServer& one : facts.servers) {
    const std::string name = "fiducapd (process " + std::to_string(one.pid) + ")";
    if (one.realtime)
      good(all, name + " sends at real-time priority");
    else
      warn(all, name + " has no real-time priority: frames wait when all cores are busy", kRemedy);
  }
  if (!facts.servers.empty() || !facts.machine.realtime_most) return;
  if (*facts.machine.realtime_most < kServerPriority)
    warn(all, "a server that is started from here gets no real-time priority", kRemedy);
}

void check_unit(Findings& all, const ServerFacts& facts) {
  const std::string& unit = facts.machine.unit;
  if (unit.empty()) return;
  if (unit == "active")
    good(all, "fiducapd.service is active");
  else if (unit == "failed")
    fault(all, "fiducapd.service has failed", "`journalctl -u fiducapd -n 50` shows the reason");
  else if (facts.servers.empty())
    warn(all, "fiducapd.service is " + unit, "`systemctl enable --now fiducapd`");
  else
    warn(all, "fiducapd runs outside of its unit: it is not restarted after a failure",
         "end it and `systemctl enable --now fiducapd`");
}

void check_store(Findings& all, const StoreFacts& store,
                 const std::vector<RunningServer>& servers) {
  const std::string repair = "`fiducap map repair --store " + store.path + "`";
  if (!store.writable)
    fault(all, "the map store " + store.path + " cannot be written",
          "make file and folder writable for the user that runs fiducapd, or change map.store");
  if (!store.unreadable.empty())
    fault(all, "the map store " + store.path + " " + store.unreadable,
          repair + ", or a copy of it in its place");
  for (const std::string& one : store.damage)
    fault(all, "the map store " + store.path + ": " + one, "stop the server, then " + repair);
  if (store.holder && servers.empty())
    warn(all,
         "the map store is held by " + *store.holder + ", and that is no fiducapd of this machine",
         "end that one before a server is started");
  else if (store.holder)
    good(all, "the map store is held by " + *store.holder);
  if (!store.exists && store.writable)
    good(all, "the map store " + store.path + " is made by the first start");
  else if (store.exists && store.writable && store.damage.empty() && store.unreadable.empty())
    good(all, "the map store " + store.path + " is sound");
  if (!store.folder.free_bytes) return;
  const auto free = static_cast<double>(*store.folder.free_bytes);
  if (free < kLittleRoom_bytes)
    all.push_back({free < kNoRoom_bytes ? Grade::kFault : Grade::kWarning,
                   "the disk of the map store has " + fixed(free / 1e6, 0) + " MB left",
                   "make room, or put map.store on another disk"});
}

void check_recordings(Findings& all, const FolderFacts& folder, double bytes_per_s) {
  if (!folder.writable || !folder.free_bytes || bytes_per_s <= 0) return;
  const double minutes = static_cast<double>(*folder.free_bytes) / bytes_per_s / 60;
  const std::string text = "room for about " + fixed(minutes, 0) + " min of recording in " +
                           folder.path + " (" + fixed(bytes_per_s / 1e6, 2) + " MB/s)";
  if (minutes < kShortSession_min)
    warn(all, text,
         "make room, change recorder.folder, or record without images (recorder.images)");
  else
    good(all, text);
}

double image_px(const BodyConfig& body, const CameraMount& mount) {
  if (mount.model.width > 0) return 1.0 * mount.model.width * mount.model.height;
  const CameraDeviceConfig& device = body.source.camera;
  if (body.source.type == SourceType::kCamera && device.width > 0)
    return 1.0 * device.width * device.height;
  return kUnknownImage_px;
}

}  // namespace

bool is_loopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1";
}

std::vector<std::string> faults_of(const ServedProtocol& protocol,
                                   const std::vector<ListeningPort>& listening,
                                   const std::vector<NetworkInterface>& interfaces) {
  std::vector<std::string> faults;
  const bool known =
      is_any(protocol.address) || std::ranges::any_of(interfaces, [&](const auto& one) {
        return one.address == protocol.address;
      });
  if (!known)
    faults.push_back("no interface of this machine has that address; set streaming." +
                     std::string(protocol.name) + ".address to one of those above");
  for (const OwnSocket& socket : sockets_of(protocol)) {
    const bool heard = std::ranges::any_of(listening, [&](const ListeningPort& one) {
      return is_at(one, socket.port) && (one.address == socket.address || is_any(one.address));
    });
    if (!heard && socket.port.number != 0 && !socket.port.optional)
      faults.push_back("no program listens on " + text_of(socket.port) +
                       ": is fiducapd running with this configuration? Its log names a port that "
                       "it could not open");
  }
  return faults;
}

std::vector<std::string> faults_of(const dds::NetworkConfig& network, const ServerFacts& facts,
                                   const std::vector<NetworkInterface>& interfaces) {
  std::vector<std::string> faults;
  const bool known =
      network.interface.empty() || std::ranges::any_of(interfaces, [&](const auto& one) {
        return one.name == network.interface || one.address == network.interface;
      });
  if (!known)
    faults.push_back(
        "no interface of this machine has that name or address; set dds.interface to one of those "
        "above");
  // RTPS 2.2, 9.6.1.1: discovery port of participant i of a domain.
  const int first = 7400 + 250 * network.domain + 10;
  const bool heard = std::ranges::any_of(facts.listening, [&](const ListeningPort& one) {
    const int index = (one.port - first) / 2;
    return one.transport == Transport::kUdp && one.port >= first && (one.port - first) % 2 == 0 &&
           index < network.max_participants;
  });
  if (!heard)
    faults.push_back("no program listens on " + std::to_string(first) +
                     " udp or the ports after it: is fiducapd running "
                     "with this configuration? Its log has the reason");
  else if (facts.dds_found == false)
    faults.push_back(
        "programs of this machine with default settings do not find the server: start them with "
        "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST (ROS 2 Humble and older: ROS_LOCALHOST_ONLY=1), "
        "or set dds.interface to the card that they use");
  return faults;
}

Findings exposure_findings(const ServerConfig& config, const ServerFacts& facts,
                           const std::vector<NetworkInterface>& interfaces) {
  Findings all;
  for (const ServedProtocol& protocol : served_protocols(config.streaming)) {
    if (!protocol.enabled) continue;
    const std::string name(protocol.name);
    if (is_loopback(protocol.address)) {
      good(all, name + " is for this machine only");
      continue;
    }
    const std::string text =
        name + " on " + protocol.address + " is open to " + allowed_clients(config, protocol.name);
    const auto reached = std::ranges::find_if(interfaces, [&](const auto& card) {
      return card.up && is_public(card.address) &&
             (is_any(protocol.address) || card.address == protocol.address);
    });
    if (reached == interfaces.end())
      good(all, text);
    else
      warn(
          all,
          text + "; " + reached->address + " (" + reached->name + ") is an address of the internet",
          "streaming." + name + ".address: one of the lab's network, or a firewall before it");
  }
  if (config.streaming.dds.enabled && config.dds.interface != "lo" &&
      !is_loopback(config.dds.interface))
    warn(all,
         "dds on " +
             (config.dds.interface.empty() ? "a card of its choice" : config.dds.interface) +
             " is open to all machines of that network: it has no password",
         "dds.interface: lo, or a network of its own");
  check_natnet(all, config.streaming.natnet);
  add_checks(all, access_checks(config));
  check_token(all, facts.token);
  return all;
}

Findings loss_findings(const ServerFacts& facts) {
  Findings all;
  for (const ListeningPort& one : facts.listening) {
    if (one.discarded == 0 || one.owner.empty()) continue;
    warn(all,
         one.owner + " at UDP port " + std::to_string(one.port) + " has lost " +
             std::to_string(one.discarded) + " datagrams that had arrived: it reads too slowly",
         "a larger buffer (SO_RCVBUF, net.core.rmem_max), or less work between two reads");
  }
  return all;
}

Findings machine_findings(const ServerConfig& config, const ServerFacts& facts) {
  Findings all;
  const MachineFacts& machine = facts.machine;
  const auto bodies = static_cast<int>(config.bodies.size());
  const std::string load =
      std::to_string(bodies) + " bodies on " + std::to_string(machine.cores) + " cores";
  if (machine.cores > 0 && bodies > machine.cores)
    warn(all, load + ": images may be left out", "fewer cameras or lower rates, or more cores");
  else if (machine.cores > 0 && bodies > 0)
    good(all, load);
  if (machine.governor == "powersave")
    warn(all, "the cores save power (cpufreq governor powersave): latency jumps",
         "`sudo cpupower frequency-set -g performance`");
  check_priority(all, facts);
  check_buffer(all, "net.core.rmem_max", machine.receive_buffer_most);
  check_buffer(all, "net.core.wmem_max", machine.send_buffer_most);
  if (machine.clock_synchronised && !*machine.clock_synchronised)
    warn(all, "the clock of this machine is not synchronised: stamps do not match other machines'",
         "run chrony or systemd-timesyncd (`timedatectl set-ntp true`)");
  else if (machine.clock_synchronised)
    good(all, "the clock is synchronised");
  check_unit(all, facts);
  return all;
}

Findings disk_findings(const ServerConfig& config, const ServerFacts& facts) {
  Findings all;
  if (facts.store) check_store(all, *facts.store, facts.servers);
  add_checks(all, storage_checks(config, facts.recordings));
  check_recordings(all, facts.recordings, recording_rate(config));
  return all;
}

Findings port_findings(const ServerConfig& config, const ServerFacts& facts) {
  Findings all;
  for (const OwnSocket& socket : sockets_of(config)) {
    const auto taken = std::ranges::find_if(facts.listening, [&](const auto& one) {
      return is_at(one, socket.port) && !one.owner.empty() && !one.owner.starts_with("fiducapd ");
    });
    if (socket.port.number == 0 || taken == facts.listening.end()) continue;
    fault(all, socket.section + ": port " + text_of(socket.port) + " is used by " + taken->owner,
          "end that, or set " + socket.key() + " to a free one");
  }
  return all;
}

double recording_rate(const ServerConfig& config) {
  double bytes_per_s = 0;
  for (const BodyConfig& body : config.bodies) {
    if (body.use_imu) bytes_per_s += kImu_hz * kImuRow_bytes;
    std::vector<CameraMount> mounts;
    for (const CameraConfig& camera : body.cameras) mounts.push_back(camera.mount);
    if (mounts.empty() && body.source.type == SourceType::kSimulator)
      mounts = body.source.simulator.cameras;
    if (mounts.empty()) mounts.emplace_back();
    const bool asked = body.source.type == SourceType::kCamera && body.source.camera.rate_hz > 0;
    for (const CameraMount& mount : mounts)
      bytes_per_s +=
          (asked ? body.source.camera.rate_hz : mount.rate_hz) *
          (config.recorder.images ? kPixel_bytes * image_px(body, mount) : kCorners_bytes);
  }
  return bytes_per_s;
}

}  // namespace fiducap
