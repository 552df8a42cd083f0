#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// `10.0.0.0/24`, `fd00:1::/64`; a single address is one, too.
struct Network {
  Peer::Address address{};  ///< IPv4 as ::ffff:a.b.c.d; the bits after the prefix are 0.
  int prefix{128};          ///< Of all 128 bits: that of an IPv4 network is 96 longer than written.

  [[nodiscard]] bool contains(const Peer& peer) const;
  auto operator<=>(const Network&) const = default;
};

/// @return nullopt for any other text
[[nodiscard]] std::optional<Network> parse_network(const std::string& text);
[[nodiscard]] std::string text_of(const Network& network);
/// The one that an administrator would most likely name: /24 of IPv4, /64 of IPv6.
[[nodiscard]] Network usual_network_of(const Peer& peer);
/// Those that this machine is directly attached to, its loopback included.
[[nodiscard]] std::vector<Network> attached_networks();

/// Whose sender addresses are believed without a proof, under protocols that have none: those of
/// networks that this machine is attached to, since routers do not let them in from outside, and
/// those that the configuration names. Everybody else may forge them.
class TrustedNetworks final {
 public:
  using Attached = std::function<std::vector<Network>()>;

  explicit TrustedNetworks(std::vector<Network> configured, Attached attached = attached_networks)
      : configured_(std::move(configured)), attached_(std::move(attached)) {}
  /// Cards come and go: asks the system again, at most every few seconds.
  [[nodiscard]] bool contains(const Peer& peer, Instant now);

 private:
  [[nodiscard]] bool knows(const Peer& peer) const;

  std::vector<Network> configured_;
  Attached attached_;
  std::vector<Network> known_;
  std::optional<Instant> asked_at_;
};

}  // namespace fiducap::net
