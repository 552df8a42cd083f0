#include "middleware/net/networks.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>

#include <bit>
#include <cstring>
#include <memory>

#include "base/text.hpp"

namespace fiducap::net {

namespace {

constexpr int kIpv4Prefix = 96;  // ::ffff:0:0/96
constexpr Duration kQueryAgain = std::chrono::seconds(5);
constexpr Duration kForgetAfter = std::chrono::seconds(60);

Peer::Address masked(Peer::Address address, int prefix) {
  for (std::size_t i = 0; i < address.size(); ++i) {
    const int bits = std::clamp(prefix - 8 * static_cast<int>(i), 0, 8);
    address[i] = static_cast<std::uint8_t>(address[i] & (0xff00 >> bits));
  }
  return address;
}

int ones(std::span<const std::uint8_t> mask) {
  int all = 0;
  for (const std::uint8_t byte : mask) all += std::popcount(byte);
  return all;
}

/// @return with the whole address, not masked
std::optional<Network> network_of(const ifaddrs& card) {
  if (card.ifa_addr == nullptr || card.ifa_netmask == nullptr) return std::nullopt;
  if (card.ifa_addr->sa_family == AF_INET) {
    const auto address = reinterpret_cast<const sockaddr_in*>(card.ifa_addr)->sin_addr.s_addr;
    const auto mask = reinterpret_cast<const sockaddr_in*>(card.ifa_netmask)->sin_addr.s_addr;
    const int prefix = kIpv4Prefix + std::popcount(mask);
    return Network{Peer(ntohl(address), 0).address, prefix};
  }
  if (card.ifa_addr->sa_family != AF_INET6) return std::nullopt;
  Peer::Address address{};
  Peer::Address mask{};
  std::memcpy(address.data(), &reinterpret_cast<const sockaddr_in6*>(card.ifa_addr)->sin6_addr, 16);
  std::memcpy(mask.data(), &reinterpret_cast<const sockaddr_in6*>(card.ifa_netmask)->sin6_addr, 16);
  return Network{address, ones(mask)};
}

/// Loopback, and what `network_of` gives for each interface that is up, changed.
template <typename Change>
std::vector<Network> networks_of_interfaces(Change change) {
  std::vector<Network> found{{Peer(0x7f000000, 0).address, kIpv4Prefix + 8}};
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return found;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(first, &::freeifaddrs);
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    if ((one->ifa_flags & IFF_UP) == 0) continue;
    if (const auto network = network_of(*one)) found.push_back(change(*network));
  }
  return found;
}

}  // namespace

bool Network::contains(const Peer& peer) const { return masked(peer.address, prefix) == address; }

std::optional<Network> parse_network(const std::string& text) {
  const auto slash = text.find('/');
  const std::string host = text.substr(0, slash);
  const auto ipv4 = parse_address(host);
  Peer::Address address = ipv4 ? Peer(*ipv4, 0).address : Peer::Address{};
  if (!ipv4 && ::inet_pton(AF_INET6, host.c_str(), address.data()) != 1) return std::nullopt;
  const int most = ipv4 ? 32 : 128;
  int bits = most;
  if (slash != std::string::npos &&
      (!parse_number(text.substr(slash + 1), bits) || bits < 0 || bits > most))
    return std::nullopt;
  const int prefix = bits + (ipv4 ? kIpv4Prefix : 0);
  return Network{masked(address, prefix), prefix};
}

std::string text_of(const Network& network) {
  const Peer first(network.address, 0);
  const int bits = network.prefix - (first.is_ipv4() ? kIpv4Prefix : 0);
  return address_text(first) + "/" + std::to_string(bits);
}

Network usual_network_of(const Peer& peer) {
  const int prefix = peer.is_ipv4() ? kIpv4Prefix + 24 : 64;
  return {masked(peer.address, prefix), prefix};
}

std::vector<Network> attached_networks() {
  return networks_of_interfaces([](const Network& one) {
    return Network{masked(one.address, one.prefix), one.prefix};
  });
}

std::vector<Network> own_addresses() {
  return networks_of_interfaces([](const Network& one) { return Network{one.address, 128}; });
}

bool TrustedNetworks::contains(const Peer& peer, Instant now) {
  const bool is_trusted = has(peer);
  if (queried_at_ && now - *queried_at_ <= (is_trusted ? kForgetAfter : kQueryAgain))
    return is_trusted;
  queried_at_ = now;
  attached_now_ = attached_();
  return has(peer);
}

}  // namespace fiducap::net
