#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// `10.0.0.0/24`, `fd00:1::/64`; also a single address.
struct Network {
  Peer::Address address{};  ///< IPv4 as ::ffff:a.b.c.d; the bits after the prefix are 0.
  int prefix{128};          ///< Of 128 bits: for IPv4 96 more than in the text.

  [[nodiscard]] bool contains(const Peer& peer) const;
  auto operator<=>(const Network&) const = default;
};

/// @return nullopt for any other text
[[nodiscard]] std::optional<Network> parse_network(const std::string& text);
[[nodiscard]] std::string text_of(const Network& network);
/// The usual network of an address: /24 for IPv4, /64 for IPv6.
[[nodiscard]] Network usual_network_of(const Peer& peer);
/// The attached networks of this machine, including loopback.
[[nodiscard]] std::vector<Network> attached_networks();

/// This machine's own addresses: all of loopback, and single ones. They cannot be forged from
/// outside.
[[nodiscard]] std::vector<Network> own_addresses();

/// Networks whose sender addresses are accepted without a proof: attached networks, since routers
/// do not forward their addresses from outside, and configured ones. Other addresses may be forged.
class TrustedNetworks final {
 public:
  using Attached = std::function<std::vector<Network>()>;

  explicit TrustedNetworks(std::vector<Network> configured, Attached attached = attached_networks)
      : configured_(std::move(configured)), attached_(std::move(attached)) {}
  /// Queries the interfaces of the system again, at most every few seconds.
  [[nodiscard]] bool contains(const Peer& peer, Instant now);

 private:
  [[nodiscard]] bool has(const Peer& peer) const {
    const auto matches = [&](const Network& network) { return network.contains(peer); };
    return std::ranges::any_of(configured_, matches) || std::ranges::any_of(attached_now_, matches);
  }

  std::vector<Network> configured_;
  Attached attached_;
  std::vector<Network> attached_now_;
  std::optional<Instant> queried_at_;
};

/// Limits the bytes sent to a forgeable address to `kRatio` times the bytes received from it.
class AnswerBudget final {
 public:
  static constexpr double kRatio = 3;
  static constexpr double kMostSaved = 16384;

  void count_received(std::uint64_t address_hash, std::size_t bytes) {
    double& saved = saved_[address_hash % saved_.size()];
    saved = std::min(kMostSaved, saved + kRatio * static_cast<double>(bytes));
  }
  [[nodiscard]] bool take(std::uint64_t address_hash, std::size_t bytes) {
    double& saved = saved_[address_hash % saved_.size()];
    if (static_cast<double>(bytes) > saved) return false;
    saved -= static_cast<double>(bytes);
    return true;
  }

 private:
  std::array<double, 1024> saved_{};
};

/// Rule for all protocols whose senders do not prove their address: addresses of trusted networks
/// are accepted; any other address gets at most three times the bytes received from it.
class SenderRule final {
 public:
  /// @param key  random for each start of the server
  SenderRule(const std::array<std::uint64_t, 2>& key, TrustedNetworks networks)
      : key_(key), networks_(std::move(networks)) {}

  /// Counts a received datagram. @return true: the sender's address is trusted
  bool count_received(const Peer& from, std::size_t bytes, Instant now) {
    if (networks_.contains(from, now)) return true;
    untrusted_.count_received(address_hash(key_, from), bytes);
    return false;
  }
  /// Whether these bytes may go to an untrusted address; counts them if so.
  [[nodiscard]] bool may_answer_untrusted(const Peer& to, std::size_t bytes) {
    return untrusted_.take(address_hash(key_, to), bytes);
  }

 private:
  std::array<std::uint64_t, 2> key_;
  TrustedNetworks networks_;
  AnswerBudget untrusted_;
};

}  // namespace fiducap::net
