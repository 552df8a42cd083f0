#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "streaming/native/codec.hpp"
#include "streaming/native/profile.hpp"
#include "streaming/native/token_mint.hpp"
#include "streaming/net/limits.hpp"

namespace fiducap::native {

using net::AnswerLimiter;

struct RegistryLimits {
  int max_clients{64};
  int max_clients_per_address{16};
  Duration lease{std::chrono::seconds(3)};
};

/// A client that proved its address and has time left.
struct Subscriber {
  Peer peer;
  std::string name;  ///< As it calls itself; printable ASCII, may be empty.
  Instant since{};
  Instant lease_until{};
  std::optional<Instant> model_sent_at;
  std::uint64_t frames_sent{};
  std::uint64_t frames_dropped{};  ///< The socket's buffer was full.
  std::uint32_t profile{};         ///< Number.
  bool multicast{};                ///< Its frames go to the group.
  // As the client reports:
  std::uint64_t lost_on_the_way{};
  Duration clock_offset{};
  Duration clock_sigma{};  ///< 0: not measured.
  Duration latency_p99{};  ///< 0: unknown.
};

/// Where frames go for clients that want multicast. Port 0: there is no group.
struct MulticastGroup {
  std::array<std::uint8_t, 4> address{};
  std::uint16_t port{};
};

/// Datagrams that got no answer, by reason.
struct Unanswered {
  std::uint64_t malformed{};
  std::uint64_t too_often{};
};

/// The conversation with all clients: datagram in → datagram out, time passed in, no socket.
///
/// Nothing is remembered about an address before it returned a token, and it is answered at most
/// once per question, never with more bytes than came. At most `max_clients` are remembered; the
/// lease ends those that fall silent. When places or profiles are short, the address with the most
/// gives one up (`net::place_for`).
class Registry final {
 public:
  /// @param key, session  random for each start of the server; session is not 0
  Registry(const RegistryLimits& limits, const std::array<std::uint64_t, 2>& key,
           std::uint64_t session);
  /// For clients that ask for it. None: everybody gets unicast.
  void offer_multicast(const MulticastGroup& group) { group_ = group; }
  /// What anybody is told who asks who is here; nullopt: nothing.
  void introduce_as(std::optional<ServerCard> card) { card_ = std::move(card); }

  enum class Event { kNone, kJoined, kLeft };
  struct Reply {
    Datagram datagram;  ///< Empty: no answer.
    bool send_model{};  ///< All Model datagrams of `profile` follow the answer.
    std::uint32_t profile{};
    Event event{Event::kNone};
    std::optional<Peer> instead_of{};  ///< Forgotten, because its address has the most of all.
  };
  [[nodiscard]] Reply receive(std::span<const std::byte> datagram, const Peer& from,
                              std::uint64_t model_generation, Instant now);
  /// Forgets everyone whose lease is over. @return how many.
  std::size_t expire(Instant now);

  /// The profiles in use besides the default one.
  [[nodiscard]] std::span<const GrantedProfile> profiles() const { return profiles_.profiles(); }
  /// In the order of arrival. Counters may be changed, nothing else.
  [[nodiscard]] std::span<Subscriber> subscribers() { return subscribers_; }
  [[nodiscard]] std::span<const Subscriber> subscribers() const { return subscribers_; }
  [[nodiscard]] const Unanswered& unanswered() const { return unanswered_; }
  [[nodiscard]] std::uint64_t session() const { return session_; }

 private:
  [[nodiscard]] Reply on(const SubscribeRequest& request, const Peer& from,
                         std::uint64_t model_generation, std::size_t bytes_in, Instant now);
  [[nodiscard]] Reply on(const UnsubscribeRequest& request, const Peer& from, Instant now);
  [[nodiscard]] Reply on(const ClockRequest& request, const Peer& from, Instant now);
  [[nodiscard]] Reply on(const DiscoveryRequest& request, const Peer& from, std::size_t bytes_in,
                         Instant now);
  [[nodiscard]] Reply renew(Subscriber& subscriber, const SubscribeRequest& request,
                            std::uint32_t profile, std::uint64_t model_generation, Instant now);
  void prune_profiles();
  [[nodiscard]] Reply challenge(const SubscribeRequest& request, const Peer& from,
                                std::size_t bytes_in, Instant now);
  /// A place for one more client of this address.
  [[nodiscard]] std::optional<NoticeReason> make_room(const Peer& from,
                                                      std::optional<Peer>& instead_of);
  /// Its number, also when another address has to give up a profile for it.
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
  TokenMint mint_;
  std::uint64_t session_;
  AnswerLimiter limiter_;
  AnswerLimiter discovery_limiter_;
  ProfileTable profiles_;
  MulticastGroup group_;
  std::optional<ServerCard> card_;
  Unanswered unanswered_;
  std::vector<Subscriber> subscribers_;
};

}  // namespace fiducap::native
