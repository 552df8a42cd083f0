#include "middleware/network.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <linux/filter.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>

#include "base/process.hpp"

namespace fiducap::dds {

namespace {

/// A host, an address or an interface; has no character that could end an XML attribute.
bool is_plain_name(const std::string& text) {
  const auto good = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
           std::string_view(".:-_%[]").find(c) != std::string_view::npos;
  };
  return !text.empty() && text.size() <= 253 && std::ranges::all_of(text, good);
}

/// @param multicast  `default`: if the interface has it; one without it is enough to disable it
std::string interface_xml(const std::string& interface, const char* multicast) {
  const bool by_address = std::isdigit(static_cast<unsigned char>(interface.front())) != 0 ||
                          interface.find(':') != std::string::npos;
  return std::string("<NetworkInterface ") + (by_address ? "address" : "name") + "=\"" + interface +
         "\" multicast=\"" + multicast + "\"/>";
}

std::string interfaces_xml(const NetworkConfig& config, const AllowedSenders& senders) {
  if (config.interface.empty()) return "";
  const bool multicast = config.uses_multicast();
  std::string xml = interface_xml(
      config.interface, multicast ? "default" : (senders.cards.empty() ? "false" : "true"));
  for (const std::string& card : senders.cards) xml += interface_xml(card, "true");
  return "<Interfaces>" + xml + "</Interfaces>";
}

std::string peers_xml(const NetworkConfig& config) {
  std::string xml;
  if (config.is_loopback()) xml += "<Peer Address=\"127.0.0.1\"/>";
  for (const auto& peer : config.peers) xml += "<Peer Address=\"" + peer + "\"/>";
  return xml.empty() ? "" : "<Peers>" + xml + "</Peers>";
}

// RTPS: the ports of a domain are consecutive.
constexpr int kFirstPort = 7400;
constexpr int kPortsPerDomain = 250;

constexpr std::uint32_t kOffsetOfSource = 12;  // in an IPv4 header

std::uint32_t address_of(const sockaddr* address) {
  return ntohl(reinterpret_cast<const sockaddr_in*>(address)->sin_addr.s_addr);
}

using Interfaces = std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)>;

/// Of the present ones; nullptr: the system gives none.
Interfaces all_interfaces() {
  ifaddrs* first = nullptr;
  return {::getifaddrs(&first) == 0 ? first : nullptr, &::freeifaddrs};
}

std::string address_text(const ifaddrs& card) {
  char text[INET_ADDRSTRLEN]{};
  const auto& address = reinterpret_cast<const sockaddr_in*>(card.ifa_addr)->sin_addr;
  return ::inet_ntop(AF_INET, &address, text, sizeof(text));
}

bool is_ipv4(const ifaddrs& card) {
  return card.ifa_addr != nullptr && card.ifa_netmask != nullptr &&
         card.ifa_addr->sa_family == AF_INET && (card.ifa_flags & IFF_UP) != 0;
}

bool is_named(const ifaddrs& card, const std::string& interface) {
  return interface == card.ifa_name || interface == address_text(card);
}

/// Adds the networks of one interface, or of all, without loopback.
void add_attached(AllowedSenders& to, const std::string& interface) {
  const Interfaces all = all_interfaces();
  std::string name;
  for (const ifaddrs* one = all.get(); one != nullptr && name.empty(); one = one->ifa_next)
    if (is_ipv4(*one) && is_named(*one, interface)) name = one->ifa_name;
  if (!name.empty()) to.interface_index = ::if_nametoindex(name.c_str());
  for (const ifaddrs* one = all.get(); one != nullptr; one = one->ifa_next) {
    if (!is_ipv4(*one) || (one->ifa_flags & IFF_LOOPBACK) != 0) continue;
    if (!interface.empty() && name != one->ifa_name) continue;
    const std::uint32_t mask = address_of(one->ifa_netmask);
    to.networks.push_back({address_of(one->ifa_addr) & mask, mask});
  }
}

/// @param peer  `host`, `192.168.1.7` or either with a port
std::vector<std::uint32_t> look_up(std::string peer) {
  if (std::count(peer.begin(), peer.end(), ':') == 1) peer.resize(peer.find(':'));
  addrinfo wanted{};
  wanted.ai_family = AF_INET;
  wanted.ai_socktype = SOCK_DGRAM;
  addrinfo* first = nullptr;
  if (::getaddrinfo(peer.c_str(), nullptr, &wanted, &first) != 0) return {};
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(first, &::freeaddrinfo);
  std::vector<std::uint32_t> found;
  for (const addrinfo* one = first; one != nullptr; one = one->ai_next)
    found.push_back(address_of(one->ai_addr));
  return found;
}

void add_peer(AllowedSenders& to, std::uint32_t peer) {
  const bool is_attached = peer >> 24 == IN_LOOPBACKNET ||
                           std::ranges::any_of(to.networks, [peer](const Ipv4Network& network) {
                             return network.contains(peer);
                           });
  if (is_attached) return;
  to.attached_only = false;
  to.networks.push_back({peer, INADDR_NONE});
}

/// The port of an IPv4 UDP socket. @return nullopt for any other descriptor
std::optional<int> udp_port(int descriptor) {
  sockaddr_in own{};
  socklen_t size = sizeof(own);
  int type = 0;
  socklen_t type_size = sizeof(type);
  if (::getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &type_size) != 0 || type != SOCK_DGRAM ||
      ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&own), &size) != 0 ||
      own.sin_family != AF_INET)
    return std::nullopt;
  return ntohs(own.sin_port);
}

std::vector<int> sockets_of(int domain) {
  const int first = kFirstPort + domain * kPortsPerDomain;
  std::vector<int> found;
  for (const int descriptor : open_descriptors()) {
    const auto port = udp_port(descriptor);
    if (port && *port >= first && *port < first + kPortsPerDomain) found.push_back(descriptor);
  }
  return found;
}

/// BPF program for each datagram: accepts this machine's, and those of allowed senders. Unicast of
/// this machine comes by `lo`, its multicast by a card, where only the kernel can mark it as looped
/// back.
std::vector<sock_filter> filter_program(const AllowedSenders& senders) {
  const sock_filter accept = BPF_STMT(BPF_RET | BPF_K, 0xffffffff);
  const sock_filter drop = BPF_STMT(BPF_RET | BPF_K, 0);
  const auto interface = static_cast<std::uint32_t>(SKF_AD_OFF + SKF_AD_IFINDEX);
  const auto type = static_cast<std::uint32_t>(SKF_AD_OFF + SKF_AD_PKTTYPE);
  const auto source = static_cast<std::uint32_t>(SKF_NET_OFF) + kOffsetOfSource;
  std::vector<sock_filter> program{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, interface),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ::if_nametoindex("lo"), 0, 1),
      accept,
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, type),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, PACKET_LOOPBACK, 0, 1),
      accept,
  };
  if (senders.interface_index != 0)
    program.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, interface));
  if (senders.interface_index != 0) {
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, senders.interface_index, 1, 0));
    program.push_back(drop);
  }
  for (const Ipv4Network& network : senders.networks) {
    program.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, source));
    program.push_back(BPF_STMT(BPF_ALU | BPF_AND | BPF_K, network.mask));
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, network.address, 0, 1));
    program.push_back(accept);
  }
  program.push_back(drop);
  return program;
}

}  // namespace

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
  for (const auto& peer : peers)
    checker.require(is_plain_name(peer), "peers", '"' + peer + '"',
                    "must be hosts or addresses, e.g. 192.168.1.7");
  for (const auto& peer : peers)
    checker.require(!is_loopback() || peer.starts_with("127.") || peer == "localhost", "peers",
                    '"' + peer + '"',
                    "must be on this machine, as dds.interface is: set that to a card for others");
  return checker.errors;
}

std::string cyclone_xml(const NetworkConfig& config, const AllowedSenders& senders) {
  const bool multicast = config.uses_multicast() || !senders.cards.empty();
  // Without multicast, participants are found by their number, which determines the port.
  return "<CycloneDDS><Domain Id=\"any\"><General>" + interfaces_xml(config, senders) +
         "<AllowMulticast>" + (multicast ? "spdp" : "false") + "</AllowMulticast>" +
         (senders.loopback_only ? "<MulticastTimeToLive>0</MulticastTimeToLive>" : "") +
         "<DontRoute>" + (senders.attached_only ? "true" : "false") +
         "</DontRoute></General><Discovery>" +
         "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>" +
         std::to_string(config.max_participants - 1) + "</MaxAutoParticipantIndex><SPDPInterval>" +
         std::to_string(static_cast<int>(config.announce_s * 1000)) + "ms</SPDPInterval>" +
         peers_xml(config) +
         // WriteBatch: packets leave at a flush, half the CPU with many instances. One receiving
         // thread: several end by packets to themselves, which never arrive without the interface.
         // WriterLingerDuration: a stop does not wait for silent readers.
         "</Discovery><Internal><WriteBatch>true</WriteBatch><MultipleReceiveThreads>false</"
         "MultipleReceiveThreads><WriterLingerDuration>100ms</"
         "WriterLingerDuration><MaxSampleSize>" +
         std::to_string(kMaxMessage) +
         "B</MaxSampleSize></Internal><Tracing><Verbosity>none</Verbosity></Tracing></Domain></"
         "CycloneDDS>";
}

AllowedSenders allowed_senders(const NetworkConfig& config) {
  AllowedSenders found;
  found.loopback_only = config.is_loopback();
  if (found.loopback_only) {
    found.cards = local_cards();
    return found;
  }
  add_attached(found, config.interface);
  for (const std::string& peer : config.peers)
    for (const std::uint32_t address : look_up(peer)) add_peer(found, address);
  return found;
}

std::vector<std::string> local_cards() {
  constexpr std::size_t kMost = 3;
  const Interfaces all = all_interfaces();
  std::vector<const ifaddrs*> cards;
  for (const ifaddrs* one = all.get(); one != nullptr; one = one->ifa_next) {
    const bool is_known = std::ranges::any_of(cards, [one](const ifaddrs* other) {
      return std::string_view(one->ifa_name) == other->ifa_name;
    });
    if (is_ipv4(*one) && (one->ifa_flags & IFF_LOOPBACK) == 0 && !is_known) cards.push_back(one);
  }
  std::stable_partition(cards.begin(), cards.end(),
                        [](const ifaddrs* one) { return (one->ifa_flags & IFF_MULTICAST) != 0; });
  if (cards.size() > kMost) cards.resize(kMost);
  std::vector<std::string> addresses;
  for (const ifaddrs* one : cards) addresses.push_back(address_text(*one));
  return addresses;
}

Expected<void> restrict_sockets(int domain, const AllowedSenders& senders) {
  const std::string where = "domain " + std::to_string(domain);
  const std::vector<int> sockets = sockets_of(domain);
  if (sockets.empty())
    return fail(ErrorCode::kUnavailable, "the sockets of DDS cannot be found in /proc/self/fd",
                where);
  auto program = filter_program(senders);
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  for (const int socket : sockets) {
    if (::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof(filter)) == 0) continue;
    return fail(ErrorCode::kUnavailable,
                std::string("the sockets of DDS cannot be kept from other networks: ") +
                    std::strerror(errno),
                where);
  }
  return {};
}

}  // namespace fiducap::dds
