#include "middleware/network.hpp"

#include <algorithm>
#include <cctype>

namespace fiducap::dds {

namespace {

/// A host, an address or an interface: nothing that could end an XML attribute.
bool is_plain_name(const std::string& text) {
  const auto good = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == ':' || c == '-' || c == '_' || c == '%' ||
           c == '[' || c == ']';
  };
  return !text.empty() && text.size() <= 253 && std::all_of(text.begin(), text.end(), good);
}

std::string interface_xml(const std::string& interface, bool multicast) {
  if (interface.empty()) return "";
  const bool by_address = std::isdigit(static_cast<unsigned char>(interface.front())) != 0 ||
                          interface.find(':') != std::string::npos;
  return std::string("<Interfaces><NetworkInterface ") + (by_address ? "address" : "name") + "=\"" +
         interface + "\"" + (multicast ? "" : " multicast=\"false\"") + "/></Interfaces>";
}

std::string peers_xml(const NetworkConfig& config) {
  std::string xml;
  if (config.is_loopback()) xml += "<Peer Address=\"127.0.0.1\"/>";
  for (const auto& peer : config.peers) xml += "<Peer Address=\"" + peer + "\"/>";
  return xml.empty() ? "" : "<Peers>" + xml + "</Peers>";
}

}  // namespace

bool NetworkConfig::is_loopback() const {
  return interface == "lo" || interface.starts_with("127.") || interface == "::1";
}

bool NetworkConfig::uses_multicast() const { return peers.empty() && !is_loopback(); }

std::vector<ConfigError> NetworkConfig::check() const {
  Checker checker{"dds."};
  checker
      .within("domain", domain, 0, 232)  // above, the ports of RTPS leave 16 bits
      .require(interface.empty() || is_plain_name(interface), "interface", '"' + interface + '"',
               "must be an interface's name or address, e.g. lo, eth0 or 192.168.1.5")
      .within("max_participants", max_participants, 1, 119)
      .within("announce_s", announce_s, 0.1, 60)
      .require(peers.size() <= 64, "peers", std::to_string(peers.size()) + " entries",
               "must be at most 64");
  for (const auto& peer : peers) {
    checker.require(is_plain_name(peer), "peers", '"' + peer + '"',
                    "must be hosts or addresses, e.g. 192.168.1.7");
  }
  return checker.errors;
}

std::string cyclone_xml(const NetworkConfig& config, bool attached_only) {
  const bool multicast = config.uses_multicast();
  // Only participants with a number can be asked at a peer's address; with multicast any port will
  // do, but those who list us as their peer still want a number.
  return "<CycloneDDS><Domain Id=\"any\"><General>" + interface_xml(config.interface, multicast) +
         "<AllowMulticast>" + (multicast ? "spdp" : "false") + "</AllowMulticast><DontRoute>" +
         (attached_only ? "true" : "false") + "</DontRoute></General><Discovery>" +
         "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>" +
         std::to_string(config.max_participants - 1) + "</MaxAutoParticipantIndex><SPDPInterval>" +
         std::to_string(static_cast<int>(config.announce_s * 1000)) + "ms</SPDPInterval>" +
         peers_xml(config) +
         // Packets leave when a writer is flushed: half the CPU where a writer has many instances.
         // With several receiving threads each is ended by a packet to itself: when the interface
         // has gone, never.
         "</Discovery><Internal><WriteBatch>true</WriteBatch><MultipleReceiveThreads>false</"
         "MultipleReceiveThreads><MaxSampleSize>" +
         std::to_string(kMaxMessage) +
         "B</MaxSampleSize></Internal><Tracing><Verbosity>none</Verbosity></Tracing></Domain></"
         "CycloneDDS>";
}

}  // namespace fiducap::dds
