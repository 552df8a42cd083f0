#include "streaming/natnet/interfaces.hpp"

#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <memory>

namespace fiducap::natnet {

namespace {

struct Card {
  std::string name;
  std::uint32_t address{};
  std::uint32_t broadcast{};  ///< 0: none
  bool multicast{};
};

std::uint32_t address_in(const sockaddr* from) {
  return ntohl(reinterpret_cast<const sockaddr_in*>(from)->sin_addr.s_addr);
}

/// IPv4 cards that are up, without the loopback.
std::vector<Card> cards() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(first, &::freeifaddrs);
  std::vector<Card> found;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    const bool usable = (one->ifa_flags & IFF_UP) != 0 && (one->ifa_flags & IFF_LOOPBACK) == 0;
    if (!usable || one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    const bool broadcasts = (one->ifa_flags & IFF_BROADCAST) != 0 && one->ifa_broadaddr != nullptr;
    found.push_back({one->ifa_name, address_in(one->ifa_addr), broadcasts ? address_in(one->ifa_broadaddr) : 0,
                     (one->ifa_flags & IFF_MULTICAST) != 0});
  }
  return found;
}

std::string dotted(std::uint32_t address) {
  const std::string with_port = text_of(Peer{address, 0});
  return with_port.substr(0, with_port.find(':'));
}

}  // namespace

std::vector<std::string> broadcast_addresses(const std::string& address) {
  const auto own = parse_address(address);
  if (!own || *own == INADDR_ANY) return {};
  if (Peer{*own, 0}.is_loopback()) return {"127.255.255.255"};
  std::vector<std::string> all{"255.255.255.255"};
  for (const Card& card : cards()) {
    if (card.address == *own && card.broadcast != 0) all.push_back(dotted(card.broadcast));
  }
  return all;
}

Expected<std::uint32_t> multicast_interface(const NatNetConfig& config) {
  const auto named = parse_address(config.multicast_interface.empty() ? config.address : config.multicast_interface);
  if (named && *named != INADDR_ANY) return *named;
  std::vector<Card> able;
  for (const Card& card : cards()) {
    if (card.multicast) able.push_back(card);
  }
  if (able.empty()) return INADDR_LOOPBACK;
  if (able.size() == 1) return able.front().address;
  std::string choices;
  for (const Card& card : able) choices += (choices.empty() ? "" : ", ") + dotted(card.address) + " (" + card.name + ")";
  return fail(ErrorCode::kInvalid, "this machine has several network cards; set it to the one the clients are on: " + choices,
              "streaming.natnet.multicast_interface");
}

}  // namespace fiducap::natnet
