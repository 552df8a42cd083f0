#include "streaming/natnet/natnet.hpp"

#include <utility>

namespace fiducap::natnet {

namespace {

constexpr std::uint32_t kFirstGroup = 0xe0000000;  // 224.0.0.0
constexpr std::uint32_t kLastGroup = 0xefffffff;
constexpr std::size_t kMostTargets = 64;
constexpr std::size_t kMostNetworks = 64;

bool is_address(const std::string& text) { return parse_address(text).has_value(); }

bool is_group(std::uint32_t address) { return address >= kFirstGroup && address <= kLastGroup; }

bool is_group(const std::string& text) {
  const auto address = parse_address(text);
  return address && is_group(*address);
}

/// @return nullopt when `text` is not a target of this kind
std::optional<Peer> target_in(const std::string& text, bool group) {
  const auto target = parse_peer(text);
  if (!target || is_group(target->ipv4()) != group) return std::nullopt;
  return target;
}

}  // namespace

std::vector<ConfigError> NatNetConfig::check() const {
  const auto version = parse_bitstream(bitstream);
  Checker rules{"streaming.natnet."};
  rules
      .require(is_address(address), "address", address,
               "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
      .require(unicast || multicast, "unicast", "false",
               "must be on when multicast is off: no client would get frames")
      .require(is_group(multicast_group), "multicast_group", multicast_group,
               "must be a multicast address, 224.0.0.0 to 239.255.255.255")
      .require(!multicast || data_port != 0, "data_port", data_port,
               "must not be 0 with multicast: clients listen at a port that they know")
      .require(multicast_interface.empty() || is_address(multicast_interface),
               "multicast_interface", multicast_interface,
               "must be the IPv4 address of one of this machine's interfaces, or empty")
      .within("multicast_ttl", multicast_ttl, 0, 255)
      .require(version && is_supported(*version), "bitstream", bitstream,
               "must be 2.5 to 2.10, 3.0, 3.1 or 4.0 to 4.4")
      .require(up != UpAxis::kDown, "up", name_of(up),
               "must be y or z: mocap clients know no other")
      .require(targets.size() <= kMostTargets, "targets", targets.size(), "must be at most 64")
      .within("max_clients", max_clients, 1, 256)
      .within("max_clients_per_address", max_clients_per_address, 1, 256)
      .within("client_timeout_s", client_timeout_s, 2, 600);
  for (const auto& target : targets)
    rules.require(parse_peer(target).has_value(), "targets", target,
                  "must be ip:port, e.g. 10.0.0.7:1511");
  rules.require(multicast || groups().empty() || parse_address(address).value_or(0) != 0 ||
                    !multicast_interface.empty(),
                "multicast_interface", multicast_interface,
                "must name an interface: targets has a group, and address is that of none");
  rules.require(networks.size() <= kMostNetworks, "networks", networks.size(),
                "must be at most 64");
  rules.require(clients.size() <= kMostNetworks, "clients", clients.size(), "must be at most 64")
      .require(clients.empty() || networks.empty(), "networks", networks.size(),
               "must be empty when clients are named: they are the only ones");
  for (const auto& [key, list] : {std::pair("networks", &networks), std::pair("clients", &clients)})
    for (const auto& network : *list)
      rules.require(net::parse_network(network).has_value(), key, network,
                    "must be a network, e.g. 10.1.0.0/16, or an address");
  return rules.errors;
}

std::vector<Peer> NatNetConfig::groups() const {
  std::vector<Peer> all;
  if (const auto group = parse_address(multicast_group); multicast && group)
    all.emplace_back(*group, data_port);
  for (const auto& text : targets)
    if (const auto target = target_in(text, true)) all.push_back(*target);
  return all;
}

std::vector<Peer> NatNetConfig::listeners() const {
  std::vector<Peer> all;
  for (const auto& text : targets)
    if (const auto listener = target_in(text, false)) all.push_back(*listener);
  return all;
}

std::vector<net::Network> NatNetConfig::trusted_networks() const {
  std::vector<net::Network> all;
  for (const auto& text : clients.empty() ? networks : clients)
    if (const auto network = net::parse_network(text)) all.push_back(*network);
  for (const Peer& listener : listeners()) all.push_back({listener.address, 128});
  return all;
}

ServedProtocol NatNetConfig::served() const {
  // It does not listen at the data port.
  std::vector<PortUse> ports;
  ports.push_back({port, true});
  if (unicast && multicast) ports.push_back({unicast_port, true, "unicast_port"});
  return {"natnet", enabled, address, std::move(ports), axes(), when_invalid};
}

}  // namespace fiducap::natnet
