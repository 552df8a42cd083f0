#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <optional>
#include <span>
#include <vector>

#include "middleware/net/peer.hpp"

// Who gets one of a bounded number of places, and who gives one up for it.
namespace fiducap::net {

/// The address that holds the most places, and at least `least` of them; it gives one up when all
/// are taken and somebody with at least two fewer wants one, so that nobody keeps others out.
[[nodiscard]] inline std::optional<Peer> greediest_address(std::span<const Peer> holders,
                                                           std::ptrdiff_t least) {
  std::optional<Peer> greediest;
  for (const Peer& one : holders) {
    const auto has = std::count_if(holders.begin(), holders.end(),
                                   [&](const Peer& other) { return other.same_address(one); });
    if (has < least) continue;
    least = has + 1;
    greediest = one;
  }
  return greediest;
}

/// Whether somebody gets one of a bounded number of places.
struct Place {
  bool is_there{};
  std::optional<Peer> instead_of{};  ///< The address that gives one up for it.
};

/// The operator can always get in from the machine itself: with fewer places than this (and than
/// half of all), loopback is given one by whoever else has the most.
inline constexpr std::ptrdiff_t kOperatorPlaces = 4;

/// The one rule for places, whatever they are: connections, clients, pages, profiles.
/// @param holders  who has one, an entry for each   @param most  places there are
[[nodiscard]] inline Place place_for(const Peer& peer, std::span<const Peer> holders,
                                     std::size_t most) {
  if (holders.size() < most) return {true};
  if (peer.is_loopback()) {
    std::vector<Peer> remote;
    std::copy_if(holders.begin(), holders.end(), std::back_inserter(remote),
                 [](const Peer& one) { return !one.is_loopback(); });
    const auto local = std::ssize(holders) - std::ssize(remote);
    const auto reserved = std::min(kOperatorPlaces, static_cast<std::ptrdiff_t>(most + 1) / 2);
    if (local < reserved) {
      if (auto other = greediest_address(remote, 1)) return {true, other};
    }
  }
  const auto same = std::count_if(holders.begin(), holders.end(),
                                  [&](const Peer& other) { return other.same_address(peer); });
  auto greediest = greediest_address(holders, same + 2);
  return {greediest.has_value(), greediest};
}

}  // namespace fiducap::net
