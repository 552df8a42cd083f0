#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/networks.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::natnet {

using net::Peer;

/// The bodies for one unicast client, by its subscription commands. In order of precedence: a
/// single body by name or id; all or none of the rigid bodies; all or none of all types; the
/// default: all, or none after "subscribed data only".
class Selection final {
 public:
  void only_subscribed() { subscribed_only_ = true; }
  void all_types(bool wanted) { all_types_ = wanted; }
  void rigid_bodies(bool wanted) { rigid_bodies_ = wanted; }
  void body(int id, bool wanted);
  /// Back to the default, also without "subscribed data only".
  void clear() { *this = {}; }

  [[nodiscard]] bool has(int id) const;
  /// All bodies: the usual case, encoded once for many clients.
  [[nodiscard]] bool is_everything() const;
  [[nodiscard]] bool operator==(const Selection&) const = default;

 private:
  [[nodiscard]] bool by_default() const;

  bool subscribed_only_{false};
  std::optional<bool> all_types_;
  std::optional<bool> rigid_bodies_;
  std::vector<std::pair<int, bool>> bodies_;  ///< Sorted by id; at most one per body of the scene.
};

/// One unicast client; frames are sent to the address and port of its requests.
struct Subscriber {
  Peer peer;
  std::string name;  ///< From the client, may be empty.
  Bitstream version;
  Bitstream library{};             ///< The newest of its library; 0.0: not known.
  std::optional<bool> is_local{};  ///< It is on this machine; nullopt: not looked up yet.
  bool fixed{};                    ///< From the configuration: never removed.
  Instant since{};
  Instant heard_at{};
  Instant frames_from{};  ///< A client that starts takes an earlier frame for a reply.
  Instant bitstream_changed_until{};
  Selection selection;
  net::DatagramShare datagrams;
};

struct RegistryLimits {
  int max_clients{64};
  int max_clients_per_address{16};  ///< Of other machines; this one's may take all places.
  Duration timeout{std::chrono::seconds(15)};
};

/// The unicast clients. Bounded; when all places are taken, the address with the most loses one to
/// an address with at least two fewer.
class Registry final {
 public:
  /// A client silent for longer may be replaced when all places are taken.
  static constexpr Duration kReplaceableAfter = std::chrono::seconds(8);

  explicit Registry(const RegistryLimits& limits);

  /// @return nullptr: not a client
  [[nodiscard]] Subscriber* find(const Peer& peer);
  /// @pre find(peer) == nullptr   @return nullptr: no place
  Subscriber* add(const Peer& peer, Instant now);
  void add_fixed(const Peer& peer, Bitstream version, Instant now);
  /// @return it was a client; fixed ones stay
  bool remove(const Peer& peer);
  /// Removes timed-out clients. @return how many
  std::size_t expire(Instant now);

  [[nodiscard]] std::span<Subscriber> all() { return subscribers_; }
  [[nodiscard]] std::span<const Subscriber> all() const { return subscribers_; }

 private:
  [[nodiscard]] bool make_place(const Peer& peer, Instant now);
  /// Among those with `may_go`. @return nullptr: none
  template <typename MayGo>
  [[nodiscard]] const Subscriber* quietest(MayGo may_go) const;

  RegistryLimits limits_;
  std::vector<Subscriber> subscribers_;
};

/// Clients that connected at the multicast port and then sent nothing: the vendor's library in
/// unicast mode ends there; in multicast mode it sends an echo request at once.
class QuietConnects final {
 public:
  static constexpr Duration kSilence = std::chrono::seconds(3);
  static constexpr std::size_t kMost = 16;  ///< A new one replaces the oldest.

  void connected(const Peer& peer, Instant now);
  void heard(const Peer& peer);
  /// A peer that was silent for kSilence, each once. @return nullopt: no more of them
  [[nodiscard]] std::optional<Peer> next(Instant now);

 private:
  struct Asked {
    Peer peer;
    Instant at;
  };
  std::vector<Asked> asked_;  ///< Oldest first.
};

/// Limits reflection attacks. NatNet has no handshake: source addresses can be forged, frames are
/// sent until a timeout, and replies are longer than requests. So:
///
/// - Only addresses of trusted networks are clients.
/// - Any other address gets no frames, and only the replies that net::SenderRule allows.
/// - A trusted address gets at most `kAddressBytes_s` of replies, besides frames. This machine's
///   addresses, which cannot be forged from outside, have no limit.
///
/// Tables have a fixed size; slots are chosen by a keyed hash.
class ReflectionGuard final {
 public:
  static constexpr double kAddressBytes_s = 64e3;
  static constexpr double kAddressBurst = 1e6;  ///< 16 clients that fetch 1000 bodies at once.
  static constexpr Duration kRemembered = std::chrono::seconds(15);

  /// @param key  random for each start of the server
  ReflectionGuard(std::uint64_t key, net::TrustedNetworks networks);

  struct Sender {
    bool trusted{};
    Bitstream version{};  ///< Since it connected; 0.0: it has not.
  };
  /// Counts a received datagram. @return what is known of its sender
  Sender heard(const Peer& from, std::size_t bytes, Instant now);
  /// Sets the version for later calls of `heard`.
  void set_version(const Peer& to, Bitstream version);
  /// @return the reply may be sent; then it is counted
  [[nodiscard]] bool may_answer(const Peer& to, std::size_t bytes, bool trusted, Instant now);
  /// @return a warning about this address may be logged, once per kWarningPeriod
  [[nodiscard]] bool may_warn(const Peer& about, Instant now);

 private:
  static constexpr Duration kWarningPeriod = std::chrono::minutes(10);
  struct Seen {
    Peer peer;
    Bitstream version;
    std::int64_t at_ns{-1};
  };
  static constexpr std::size_t kSeen = 16384;  ///< Enough beside 10 000 forged datagrams a second.
  static constexpr std::size_t kBuckets = 1024;
  struct Tables {
    std::array<Seen, kSeen> seen{};
    std::array<net::TokenBucket, kBuckets> addresses{};
    std::array<std::int64_t, kBuckets> warned_ns{};
  };

  [[nodiscard]] Seen& place_of(const Peer& peer);

  std::array<std::uint64_t, 2> key_;
  net::SenderRule rule_;
  std::unique_ptr<Tables> tables_;
};

}  // namespace fiducap::natnet
