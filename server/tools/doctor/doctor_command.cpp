#include "tools/doctor/doctor_command.hpp"

#include <algorithm>
#include <chrono>

#include <nlohmann/json.hpp>

#include "fiducap/client.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "tools/doctor/server_facts.hpp"
#include "tools/doctor/server_findings.hpp"
#include "tools/live/watch_command.hpp"

namespace fiducap {

namespace {

constexpr std::chrono::milliseconds kPatience{1500};
constexpr std::string_view kGood = "  ok  ";
constexpr std::string_view kWarn = "  !   ";
constexpr std::string_view kBad = "  !!  ";
constexpr std::string_view kNote = "      ";

/// Counts what needs a remedy while it speaks; for scripts it says all at the end.
class Report final {
 public:
  Report(std::ostream& out, bool json) : out_(out), is_json_(json) {}
  void title(std::string_view text) {
    sections_.push_back({{"title", text}, {"findings", nlohmann::ordered_json::array()}});
    if (!is_json_) out_ << text << "\n";
  }
  void good(const std::string& text) { say("ok", kGood, text); }
  void warn(const std::string& text) {
    say("warning", kWarn, text);
    ++warnings_;
  }
  void bad(const std::string& text) {
    say("fault", kBad, text);
    ++bad_;
  }
  void note(const std::string& text) { say("note", kNote, text); }
  void add(const Findings& findings) {
    for (const Finding& one : findings) {
      const std::string text = one.text + (one.remedy.empty() ? "" : " – " + one.remedy);
      if (one.grade == Finding::Grade::kOk)
        good(text);
      else
        one.grade == Finding::Grade::kWarning ? warn(text) : bad(text);
    }
  }
  /// @return exit code
  int conclude() {
    const int exit_code = bad_ == 0 ? kExitOk : kExitFailed;
    if (is_json_) {
      const nlohmann::ordered_json json{
          {"faults", bad_}, {"warnings", warnings_}, {"sections", sections_}};
      out_ << json.dump(2) << "\n";
      return exit_code;
    }
    if (bad_ > 0) out_ << bad_ << " findings need a remedy (!!).\n";
    if (warnings_ > 0) out_ << warnings_ << " things could be better (!).\n";
    if (bad_ + warnings_ == 0) out_ << "All is well.\n";
    return exit_code;
  }

 private:
  /// Under the last title.
  void say(const char* grade, std::string_view mark, const std::string& text) {
    sections_.back()["findings"].push_back({{"grade", grade}, {"text", text}});
    if (!is_json_) out_ << mark << text << "\n";
  }

  std::ostream& out_;
  bool is_json_;
  nlohmann::ordered_json sections_ = nlohmann::ordered_json::array();
  int bad_{0};
  int warnings_{0};
};

bool is_loopback(const std::string& address) {
  return address.rfind("127.", 0) == 0 || address == "::1";
}
bool is_any(const std::string& address) { return address == "0.0.0.0" || address == "::"; }

void look_at_network(Report& findings, const std::vector<NetworkInterface>& interfaces) {
  findings.title("Network");
  for (const NetworkInterface& one : interfaces) {
    const std::string name = one.name + " " + one.address;
    if (!one.up) {
      findings.note(name + ": is down");
    } else if (one.loopback) {
      findings.good(name + ": this machine only");
    } else if (!one.multicast) {
      findings.note(name + ": no multicast; clients there use unicast");
    } else if (const auto fault = multicast_fault(one)) {
      findings.bad(name + ": multicast " + *fault + "; unicast clients are not touched");
    } else {
      findings.good(name + ": multicast comes back");
    }
  }
}

std::string ports_text(const ServedProtocol& protocol) {
  std::string text;
  for (const PortUse& port : protocol.ports)
    text += (text.empty() ? "" : ", ") + std::to_string(port.number) + (port.udp ? " udp" : " tcp");
  return text;
}

std::string units_text(double units_per_m) { return units_per_m == 1000.0 ? "mm" : "m"; }

std::string looks_of_lost(const ProtocolConventions& conventions, WhenInvalid policy) {
  if (policy == conventions.when_invalid) return std::string(conventions.invalid_looks);
  return policy == WhenInvalid::kHold
             ? "its last valid pose, as if it were live (when_invalid: hold)"
             : "absent (when_invalid: stop)";
}

void note_conventions(Report& findings, std::string_view protocol, const OutputAxes& axes,
                      WhenInvalid policy) {
  const ProtocolConventions& conventions = conventions_of(protocol);
  findings.note(std::string(name_of(axes.up)) + ", " + units_text(axes.units_per_m) +
                ", attitude " + std::string(conventions.attitude) +
                "; a body that is lost: " + looks_of_lost(conventions, policy) + "; stamped with " +
                std::string(conventions.stamp));
}

void look_at_protocols(Report& findings, const StreamingConfig& streaming,
                       const std::vector<ListeningPort>& listening,
                       const std::vector<NetworkInterface>& interfaces) {
  findings.title("Protocols: where they listen, what their clients receive");
  for (const ServedProtocol& protocol : served_protocols(streaming)) {
    const std::string name(protocol.name);
    if (!protocol.enabled) {
      const std::string ports = protocol.ports.empty() ? "" : " at " + ports_text(protocol);
      findings.note(name + ": switched off, its clients find nobody" + ports + " (streaming." +
                    name + ".enabled: true)");
      continue;
    }
    const auto faults = faults_of(protocol, listening, interfaces);
    const std::string place = name + " on " + protocol.address + ", " + ports_text(protocol);
    if (faults.empty()) findings.good(place);
    for (const std::string& fault : faults) findings.bad(place + ": " + fault);
    note_conventions(findings, protocol.name, protocol.axes, protocol.when_invalid);
    if (is_loopback(protocol.address))
      findings.note("reached from this machine only; streaming." + name +
                    ".address: 0.0.0.0 lets other machines in");
  }
}

void look_at_dds(Report& findings, const ServerConfig& config,
                 const std::vector<ListeningPort>& listening,
                 const std::vector<NetworkInterface>& interfaces) {
  if (!config.streaming.dds.enabled) {
    findings.note("dds: switched off (streaming.dds.enabled)");
    return;
  }
  const dds::NetworkConfig& network = config.dds;
  const std::string place =
      "dds on " + (network.interface.empty() ? "the interface it likes best" : network.interface) +
      ", ROS_DOMAIN_ID " + std::to_string(network.domain);
  const auto faults = faults_of(network, listening, interfaces);
  if (faults.empty()) findings.good(place);
  for (const std::string& fault : faults) findings.bad(place + ": " + fault);
  for (const char* profile : {"ros2", "px4"}) {
    if (profile == std::string_view("px4") && config.streaming.dds.px4 == dds::Px4Profile::kOff)
      continue;
    note_conventions(findings, profile, conventions_of(profile).axes,
                     conventions_of(profile).when_invalid);
  }
  if (network.interface == "lo" || is_loopback(network.interface)) {
    findings.note(
        "reached from this machine only; dds.interface: NAME of a card above lets other machines "
        "in");
  } else if (!network.uses_multicast()) {
    findings.note("asks dds.peers only: others must name this machine as their peer, too");
  }
}

std::string why_unseen(const Body& body) {
  switch (body.tracking) {
    case Tracking::kSearching:
      return "has seen no tag that is in the map yet: show its camera the reference tag, look at "
             "tags.family and "
             "tags.size_m";
    case Tracking::kTracking:
    case Tracking::kCoasting:
      return "is known worse than its limits allow (bodies.*.limits): more or larger tags in view";
    case Tracking::kLost:
      return "sees no tag: is its camera covered, unplugged, too dark, or too far from the tags?";
  }
  return "is not valid";
}

void look_at_server(Report& findings, const ServerAddress& address) {
  const std::string name = address.host + ":" + std::to_string(address.port);
  findings.title("Running server at " + name);
  ClientOptions options;
  options.server = address.host;
  options.port = address.port;
  options.name = "fiducap doctor";
  const Client client(options);
  Frame frame;
  if (!client.wait_for_frame(0, kPatience) || !client.latest(frame)) {
    const std::string problem = client.statistics().problem;
    findings.bad("no answer" + (problem.empty() ? "" : " (" + problem + ")") +
                 ": start fiducapd, or name its place with --server HOST:PORT");
    return;
  }
  findings.good(std::to_string(frame.bodies.size()) + " bodies at " + fixed(frame.rate_hz, 0) +
                " Hz");
  for (const Body& body : frame.bodies) {
    if (body.valid) {
      findings.good(body.name + ": " + fixed(1e3 * body.position_sigma_m, 1) + " mm 1-sigma, " +
                    std::to_string(body.tags_in_view) + " tags in view");
    } else {
      findings.bad(body.name + " " + why_unseen(body));
    }
  }
}

}  // namespace

std::vector<std::string> faults_of(const ServedProtocol& protocol,
                                   const std::vector<ListeningPort>& listening,
                                   const std::vector<NetworkInterface>& interfaces) {
  std::vector<std::string> faults;
  const bool known = is_any(protocol.address) ||
                     std::any_of(interfaces.begin(), interfaces.end(),
                                 [&](const auto& one) { return one.address == protocol.address; });
  if (!known) {
    faults.push_back("no interface of this machine has that address; set streaming." +
                     std::string(protocol.name) + ".address to one of those above");
  }
  for (const PortUse& port : protocol.ports) {
    const Transport transport = port.udp ? Transport::kUdp : Transport::kTcp;
    const bool heard =
        std::any_of(listening.begin(), listening.end(), [&](const ListeningPort& one) {
          return one.port == port.number && one.transport == transport &&
                 (one.address == protocol.address || is_any(one.address));
        });
    if (!heard && port.number != 0) {
      faults.push_back("nobody listens on " + std::to_string(port.number) +
                       (port.udp ? " udp" : " tcp") +
                       ": is fiducapd running with this configuration? Its log names a port that "
                       "it could not have");
    }
  }
  return faults;
}

std::vector<std::string> faults_of(const dds::NetworkConfig& network,
                                   const std::vector<ListeningPort>& listening,
                                   const std::vector<NetworkInterface>& interfaces) {
  std::vector<std::string> faults;
  const bool known = network.interface.empty() ||
                     std::any_of(interfaces.begin(), interfaces.end(), [&](const auto& one) {
                       return one.name == network.interface || one.address == network.interface;
                     });
  if (!known) {
    faults.push_back(
        "no interface of this machine has that name or address; set dds.interface to one of those "
        "above");
  }
  // RTPS 2.2, 9.6.1.1: participant i of a domain is asked who is there at this port.
  const int first = 7400 + 250 * network.domain + 10;
  const bool heard = std::any_of(listening.begin(), listening.end(), [&](const ListeningPort& one) {
    const int index = (one.port - first) / 2;
    return one.transport == Transport::kUdp && one.port >= first && (one.port - first) % 2 == 0 &&
           index < network.max_participants;
  });
  if (!heard) {
    faults.push_back("nobody listens on " + std::to_string(first) +
                     " udp or the ports after it: is fiducapd running "
                     "with this configuration? Its log says why it could not join");
  }
  return faults;
}

int run_doctor(const DoctorArguments& arguments, const Terminal& terminal) {
  const auto config = load_config(arguments.config, arguments.sets);
  if (!config) {
    for (const ConfigFault& fault : config.error())
      terminal.err << "fiducap: " << fault.text() << "\n";
    return kExitUsage;
  }
  const auto address = parse_server_address(arguments.server, config->streaming.native.port);
  if (!address) {
    terminal.err << "fiducap: --server must be HOST or HOST:PORT, is '" << arguments.server
                 << "'\n";
    return kExitUsage;
  }
  Report findings(terminal.out, arguments.json);
  const ServerFacts facts = gather_facts(*config, address->host);
  const auto interfaces = network_interfaces();
  look_at_network(findings, interfaces);
  look_at_protocols(findings, config->streaming, facts.listening, interfaces);
  look_at_dds(findings, *config, facts.listening, interfaces);
  findings.add(port_findings(*config, facts));
  findings.title("Who may listen, who may change things");
  findings.add(exposure_findings(*config, facts, interfaces));
  findings.title("This machine");
  findings.add(machine_findings(*config, facts));
  findings.title("Map and recordings");
  findings.add(disk_findings(*config, facts));
  look_at_server(findings, *address);
  findings.add(alarm_findings(facts));
  return findings.conclude();
}

}  // namespace fiducap
