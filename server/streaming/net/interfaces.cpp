#include "streaming/net/interfaces.hpp"

#include <ifaddrs.h>
#include <net/if.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>

namespace fiducap::net {

namespace {

std::uint32_t address_in(const sockaddr* from) {
  return ntohl(reinterpret_cast<const sockaddr_in*>(from)->sin_addr.s_addr);
}

}  // namespace

std::vector<Interface> ipv4_interfaces() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(first, &::freeifaddrs);
  std::vector<Interface> found;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    const bool usable = (one->ifa_flags & IFF_UP) != 0 && (one->ifa_flags & IFF_LOOPBACK) == 0;
    if (!usable || one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    const bool broadcasts = (one->ifa_flags & IFF_BROADCAST) != 0 && one->ifa_broadaddr != nullptr;
    found.push_back({one->ifa_name, address_in(one->ifa_addr),
                     broadcasts ? address_in(one->ifa_broadaddr) : 0,
                     (one->ifa_flags & IFF_MULTICAST) != 0});
  }
  return found;
}

bool is_this_machine(const Peer& peer) {
  if (peer.is_loopback()) return true;
  const auto all = ipv4_interfaces();
  return std::ranges::any_of(all, [&](const Interface& one) {
    return peer.same_address(Peer{one.address, 0});
  });
}

std::string host_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "fiducap";
}

std::vector<std::string> subnet_broadcasts(std::uint32_t own) {
  std::vector<std::string> all;
  for (const Interface& one : ipv4_interfaces()) {
    if (one.address == own && one.broadcast != 0)
      all.push_back(address_text(Peer{one.broadcast, 0}));
  }
  return all;
}

}  // namespace fiducap::net
