#include <array>

#include <nlohmann/json.hpp>

#include "streaming/conventions/protocol_conventions.hpp"
#include "tools/doctor/doctor.hpp"
#include "tools/live/live_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

constexpr std::chrono::milliseconds kFrameTimeout{1500};

/// Writes findings section by section and counts those that need a remedy; JSON is written at the
/// end.
class Report final {
 public:
  Report(std::ostream& out, bool json) : out_(out), is_json_(json) {}

  void add(const std::string& title, std::initializer_list<Findings> parts) {
    if (!is_json_) out_ << title << "\n";
    auto json = nlohmann::ordered_json::array();
    for (const Findings& part : parts)
      for (const Finding& one : part) {
        static constexpr std::array kNames{"ok", "warning", "fault", "note"};
        static constexpr std::array kMarks{"  ok  ", "  !   ", "  !!  ", "      "};
        const auto grade = static_cast<std::size_t>(one.grade);
        ++counts_[grade];
        const std::string text = one.text + (one.remedy.empty() ? "" : " – " + one.remedy);
        json.push_back({{"grade", kNames[grade]}, {"text", text}});
        if (!is_json_) out_ << kMarks[grade] << text << "\n";
      }
    sections_.push_back({{"title", title}, {"findings", json}});
  }
  /// @return exit code
  int conclude() {
    const std::size_t warnings = counts_[static_cast<std::size_t>(Grade::kWarning)];
    const std::size_t faults = counts_[static_cast<std::size_t>(Grade::kFault)];
    const nlohmann::ordered_json json{
        {"faults", faults}, {"warnings", warnings}, {"sections", sections_}};
    if (is_json_) out_ << json.dump(2) << "\n";
    if (!is_json_ && faults > 0)
      out_ << counted(faults, "finding needs", "findings need") << " a remedy (!!).\n";
    if (!is_json_ && warnings > 0)
      out_ << counted(warnings, "thing", "things") << " could be better (!).\n";
    if (!is_json_ && faults + warnings == 0) out_ << "All is well.\n";
    return faults == 0 ? kExitOk : kExitFailed;
  }

 private:
  std::ostream& out_;
  bool is_json_;
  nlohmann::ordered_json sections_ = nlohmann::ordered_json::array();
  std::array<std::size_t, 4> counts_{};
};

Findings network_findings(const std::vector<NetworkInterface>& interfaces) {
  Findings all;
  for (const NetworkInterface& one : interfaces) {
    const std::string name = one.name + " " + one.address;
    if (!one.up) {
      all.push_back({Grade::kNote, name + ": is down"});
    } else if (one.loopback) {
      all.push_back({Grade::kOk, name + ": this machine only"});
    } else if (!one.multicast) {
      all.push_back({Grade::kNote, name + ": no multicast; clients there use unicast"});
    } else if (const auto fault = multicast_fault(one)) {
      all.push_back(
          {Grade::kFault, name + ": multicast " + *fault + "; unicast clients are not touched"});
    } else {
      all.push_back({Grade::kOk, name + ": multicast comes back"});
    }
  }
  return all;
}

std::string ports_text(const ServedProtocol& protocol) {
  return comma_list(protocol.ports, [](const PortUse& port) { return text_of(port); });
}

std::string looks_of_lost(const ProtocolConventions& conventions, WhenInvalid policy) {
  if (policy == conventions.when_invalid) return std::string(conventions.invalid_looks);
  return policy == WhenInvalid::kHold
             ? "its last valid pose, as if it were live (when_invalid: hold)"
             : "absent (when_invalid: stop)";
}

void note_conventions(Findings& all, std::string_view protocol, const OutputAxes& axes,
                      WhenInvalid policy) {
  const ProtocolConventions& conventions = conventions_of(protocol);
  const char* unit = axes.units_per_m == 1000.0 ? "mm" : "m";
  all.push_back({Grade::kNote, std::string(name_of(axes.up)) + ", " + unit + ", attitude " +
                                   std::string(conventions.attitude) +
                                   "; a body that is lost: " + looks_of_lost(conventions, policy) +
                                   "; stamped with " + std::string(conventions.stamp)});
}

Findings protocol_findings(const StreamingConfig& streaming,
                           const std::vector<ListeningPort>& listening,
                           const std::vector<NetworkInterface>& interfaces) {
  Findings all;
  for (const ServedProtocol& protocol : served_protocols(streaming)) {
    const std::string name(protocol.name);
    if (!protocol.enabled) {
      const std::string ports = protocol.ports.empty() ? "" : " at " + ports_text(protocol);
      all.push_back({Grade::kNote, name + ": switched off, its clients find no server" + ports +
                                       " (streaming." + name + ".enabled: true)"});
      continue;
    }
    const auto faults = faults_of(protocol, listening, interfaces);
    const std::string place = name + " on " + protocol.address + ", " + ports_text(protocol);
    if (faults.empty()) all.push_back({Grade::kOk, place});
    for (const std::string& fault : faults) all.push_back({Grade::kFault, place + ": " + fault});
    if (name != "web")  // its own page
      note_conventions(all, protocol.name, protocol.axes, protocol.when_invalid);
    if (is_loopback(protocol.address))
      all.push_back({Grade::kNote, "reached from this machine only; streaming." + name +
                                       ".address: 0.0.0.0 lets other machines in"});
  }
  return all;
}

Findings vicon_udp_findings(const vicon_udp::ViconUdpConfig& config) {
  Findings all;
  if (!config.enabled) {
    all.push_back({Grade::kNote, "vicon_udp: switched off (streaming.vicon_udp.enabled)"});
    return all;
  }
  all.push_back({Grade::kOk, "vicon_udp sends to " +
                                 comma_list(config.targets, [](const auto& one) { return one; })});
  note_conventions(all, "vicon_udp", conventions_of("vicon_udp").axes, config.when_invalid);
  return all;
}

Findings dds_findings(const ServerConfig& config, const ServerFacts& facts,
                      const std::vector<NetworkInterface>& interfaces) {
  Findings all;
  if (!config.streaming.dds.enabled) {
    all.push_back({Grade::kNote, "dds: switched off (streaming.dds.enabled)"});
    return all;
  }
  const dds::NetworkConfig& network = config.dds;
  const std::string place =
      "dds on " + (network.interface.empty() ? "an interface of its choice" : network.interface) +
      ", ROS_DOMAIN_ID " + std::to_string(network.domain);
  const auto faults = faults_of(network, facts, interfaces);
  if (faults.empty())
    all.push_back(
        {Grade::kOk, place + (facts.dds_found ? ", found by programs of this machine" : "")});
  for (const std::string& fault : faults) all.push_back({Grade::kFault, place + ": " + fault});
  for (const char* profile : {"ros2", "px4"}) {
    if (profile == std::string_view("px4") && config.streaming.dds.px4 == dds::Px4Profile::kOff)
      continue;
    note_conventions(all, profile, conventions_of(profile).axes,
                     conventions_of(profile).when_invalid);
  }
  if (network.interface == "lo" || is_loopback(network.interface)) {
    all.push_back(
        {Grade::kNote,
         "reached from this machine only; dds.interface: NAME of a card above lets other machines "
         "in"});
  } else if (!network.uses_multicast()) {
    all.push_back(
        {Grade::kNote, "asks dds.peers only: others must name this machine as their peer, too"});
  }
  return all;
}

std::string why_unseen(const Body& body) {
  switch (body.tracking) {
    case Tracking::kSearching:
      return "has seen no tag of the map yet: show its camera the reference tag, check tags.family "
             "and tags.size_m";
    case Tracking::kTracking:
    case Tracking::kCoasting:
      return "is less certain than its limits allow (bodies.*.limits): more or larger tags in view";
    case Tracking::kLost:
      return "sees no tag: is its camera covered, unplugged, too dark, or too far from the tags?";
  }
  return "is not valid";
}

Findings live_findings(const ServerAddress& address) {
  Findings all;
  const Client client(client_options(address, "fiducap doctor"));
  Frame frame;
  if (!client.wait_for_frame(0, kFrameTimeout) || !client.latest(frame)) {
    const std::string problem = client.statistics().problem;
    all.push_back(
        {Grade::kFault, "no answer" + (problem.empty() ? "" : " (" + problem + ")") +
                            ": start fiducapd, or name its place with --server HOST:PORT"});
    return all;
  }
  all.push_back({Grade::kOk, std::to_string(frame.bodies.size()) + " bodies at " +
                                 fixed(frame.rate_hz, 0) + " Hz"});
  for (const Body& body : frame.bodies) {
    if (body.valid) {
      all.push_back({Grade::kOk, body.name + ": " + fixed(1e3 * body.position_sigma_m, 1) +
                                     " mm 1-sigma, " + std::to_string(body.tags_in_view) +
                                     " tags in view"});
    } else {
      all.push_back({Grade::kFault, body.name + " " + why_unseen(body)});
    }
  }
  return all;
}

}  // namespace

int run_doctor(const DoctorArguments& arguments, const Terminal& terminal) {
  const auto config = load_config(arguments.config, arguments.sets);
  if (!config) {
    for (const ConfigFault& fault : config.error())
      terminal.err << "fiducap: " << fault.text() << "\n";
    return kExitUsage;
  }
  const auto address = parse_server_address(arguments.server, config->streaming.native.port);
  if (!address) {
    report(terminal, address.error());
    return kExitUsage;
  }
  Report findings(terminal.out, arguments.json);
  const ServerFacts facts = gather_facts(*config, address->host);
  const auto interfaces = network_interfaces();
  findings.add("Network", {network_findings(interfaces)});
  findings.add(
      "Protocols: where they listen, what their clients receive",
      {protocol_findings(config->streaming, facts.listening, interfaces),
       vicon_udp_findings(config->streaming.vicon_udp), dds_findings(*config, facts, interfaces),
       port_findings(*config, facts), loss_findings(facts)});
  findings.add("Access", {exposure_findings(*config, facts, interfaces)});
  findings.add("This machine", {machine_findings(*config, facts)});
  findings.add("Map and recordings", {disk_findings(*config, facts)});
  findings.add("Running server at " + address->host + ":" + std::to_string(address->port),
               {live_findings(*address), facts.alarms});
  return findings.conclude();
}

void add_doctor(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "doctor",
      "Why does a client see nothing, what is wrong with a server? Network, ports, exposure, "
      "machine, disks, bodies, alarms");
  auto& a = arguments_of<DoctorArguments>(*verb, chosen, run_doctor);
  verb->add_option("--config", a.config, "The server's configuration; without it the defaults");
  add_set_option(*verb, a.sets);
  add_server_option(*verb, a.server);
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer("Example:\n  fiducap doctor --config config/demo.yaml");
}

}  // namespace fiducap
