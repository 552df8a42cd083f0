#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/native/codec.hpp"
#include "streaming/native/frames.hpp"
#include "streaming/native/native.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/net/udp_server.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::native {

using net::Peer;
using net::siphash;

/// Tokens that prove an address, without state per client: a keyed hash of address, port and
/// current period, valid in this and the next period.
class TokenIssuer final {
 public:
  /// @param key  secret and random for each start of the server
  /// @pre period > 0
  TokenIssuer(const std::array<std::uint64_t, 2>& key, Duration period)
      : key_(key), period_(period) {}

  /// @return never 0
  [[nodiscard]] std::uint64_t token(const Peer& peer, Instant now) const;
  [[nodiscard]] bool accepts(std::uint64_t token, const Peer& peer, Instant now) const;
  [[nodiscard]] std::uint64_t address_hash(const Peer& peer) const {
    return net::address_hash(key_, peer);
  }

 private:
  [[nodiscard]] std::uint64_t token_of_period(const Peer& peer, std::int64_t period) const;

  std::array<std::uint64_t, 2> key_;
  Duration period_;
};

using net::AnswerLimiter;

struct RegistryLimits {
  int max_clients{64};
  int max_clients_per_address{16};
  Duration lease{std::chrono::seconds(3)};
};

/// A client with a proven address and a lease.
struct Subscriber {
  Peer peer;
  std::string name;  ///< From the client; printable ASCII, may be empty.
  Instant since{};
  Instant lease_until{};
  std::optional<Instant> model_sent_at;
  net::DatagramShare datagrams;
  std::uint32_t profile{};  ///< Number.
  bool multicast{};         ///< Its frames go to the group.
  ClientReport report;
};

[[nodiscard]] RegistryLimits limits_of(const NativeConfig& config);
/// For the page, with the values that the client reports.
[[nodiscard]] ClientStatus status_of(const Subscriber& subscriber, const Profile& profile,
                                     Instant now);

/// The subscriptions of all clients: datagram in → datagram out, time passed in, no socket.
///
/// No state is kept for an address before it returned a token; it gets at most one reply per
/// request, never with more bytes than came. At most `max_clients` have a lease; silent ones lose
/// it. When all places or profiles are taken, the address with the most loses one
/// (`net::place_for`).
class Registry final {
 public:
  /// @param key, session  random for each start of the server; session is not 0
  Registry(const RegistryLimits& limits, const std::array<std::uint64_t, 2>& key,
           std::uint64_t session);
  /// For clients that request it.
  void offer_multicast(const MulticastGroup& group) { group_ = group; }
  /// Reply to discovery; nullopt: none.
  void set_discovery(std::optional<ServerCard> card) { card_ = std::move(card); }

  enum class Event { kNone, kJoined, kLeft };
  struct Reply {
    Datagram datagram;  ///< Empty: none.
    bool send_model{};  ///< All Model datagrams of `profile` follow.
    std::uint32_t profile{};
    Event event{Event::kNone};
    std::optional<Peer> instead_of{};  ///< Removed, because its address has the most.
  };
  [[nodiscard]] Reply receive(std::span<const std::byte> datagram, const Peer& from,
                              std::uint64_t model_generation, Instant now);
  /// Removes clients whose lease is over. @return how many
  std::size_t expire(Instant now);

  /// The profiles in use besides the default one.
  [[nodiscard]] std::span<const GrantedProfile> profiles() const { return profiles_.profiles(); }
  /// In the order of arrival. Counters may be changed, nothing else.
  [[nodiscard]] std::span<Subscriber> subscribers() { return subscribers_; }
  [[nodiscard]] std::span<const Subscriber> subscribers() const { return subscribers_; }
  [[nodiscard]] std::uint64_t session() const { return session_; }

 private:
  struct Sender {
    Peer from;
    std::size_t bytes_in{};
    std::uint64_t model_generation{};  ///< Ours.
    Instant now;
  };
  [[nodiscard]] Reply on(const SubscribeRequest& request, const Sender& sender);
  [[nodiscard]] Reply on(const UnsubscribeRequest& request, const Sender& sender);
  [[nodiscard]] Reply on(const ClockRequest& request, const Sender& sender);
  [[nodiscard]] Reply on(const DiscoveryRequest& request, const Sender& sender);
  [[nodiscard]] Reply renew(Subscriber& subscriber, const SubscribeRequest& request,
                            std::uint32_t profile, const Sender& sender);
  void prune_profiles();
  [[nodiscard]] Reply challenge(const SubscribeRequest& request, const Sender& sender);
  /// A place for one more client of this address.
  [[nodiscard]] std::optional<NoticeReason> make_room(const Peer& from,
                                                      std::optional<Peer>& instead_of);
  /// Its number; may remove a profile of another address.
  [[nodiscard]] std::optional<std::uint32_t> grant(const Profile& profile, const Peer& from,
                                                   std::optional<Peer>& instead_of);
  [[nodiscard]] std::optional<Peer> holder_of(std::uint32_t profile) const;
  /// The profile of this address that the fewest others use.
  [[nodiscard]] std::uint32_t spare_profile_of(const Peer& address) const;
  template <typename MayGo>
  [[nodiscard]] std::optional<Peer> forget_newest(MayGo&& may_go);
  [[nodiscard]] Reply refuse(const SubscribeRequest& request, NoticeReason reason,
                             std::size_t bytes_in) const;
  [[nodiscard]] Subscriber* find(const Peer& peer);

  RegistryLimits limits_;
  TokenIssuer tokens_;
  std::uint64_t session_;
  AnswerLimiter limiter_;
  AnswerLimiter discovery_limiter_;
  ProfileTable profiles_;
  MulticastGroup group_;
  std::optional<ServerCard> card_;
  std::vector<Subscriber> subscribers_;
};

}  // namespace fiducap::native
