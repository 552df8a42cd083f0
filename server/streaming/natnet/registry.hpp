#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/natnet/bitstream.hpp"

namespace fiducap::natnet {

using net::Peer;

/// Which bodies one unicast client wants: the outcome of its subscription commands.
///
/// Strongest first: a single body by name or id; all or none of the rigid bodies; all or none of
/// all types; the server's default, which is everything until the client says "subscribed data
/// only".
class Selection final {
 public:
  void only_subscribed() { subscribed_only_ = true; }
  void all_types(bool wanted) { all_types_ = wanted; }
  void rigid_bodies(bool wanted) { rigid_bodies_ = wanted; }
  void body(int id, bool wanted);
  /// Back to the default; "subscribed data only" goes too.
  void clear() { *this = {}; }

  [[nodiscard]] bool has(int id) const;
  /// No body is left out: the usual case, encoded for many clients at once.
  [[nodiscard]] bool is_everything() const;
  [[nodiscard]] bool operator==(const Selection&) const = default;

 private:
  [[nodiscard]] bool by_default() const;

  bool subscribed_only_{false};
  std::optional<bool> all_types_;
  std::optional<bool> rigid_bodies_;
  std::vector<std::pair<int, bool>> bodies_;  ///< Sorted by id; at most one per body of the scene.
};

/// One unicast client: gets frames at the address and port it asks from.
struct Subscriber {
  Peer peer;
  std::string name;  ///< As it calls itself, may be empty.
  Bitstream version;
  bool fixed{};  ///< From the configuration: never asked, never forgotten.
  Instant since{};
  Instant heard_at{};
  Instant frames_from{};  ///< Nothing before: a slow start-up takes a frame for an answer.
  Instant bitstream_changed_until{};
  Selection selection;
  std::uint64_t frames_sent{};
  std::uint64_t frames_dropped{};  ///< The socket's buffer was full.
};

struct RegistryLimits {
  int max_clients{64};
  int max_clients_per_address{16};  ///< Of others; this machine's own may take all places.
  Duration timeout{std::chrono::seconds(15)};
};

/// Who gets frames. Bounded, and shared fairly: when all places are taken, the address with the
/// most of them gives one to an address that has at least two fewer, so that nobody can keep others
/// out.
class Registry final {
 public:
  /// A client silent for longer gives its place to a new one when all are taken.
  static constexpr Duration kReplaceableAfter = std::chrono::seconds(8);

  explicit Registry(const RegistryLimits& limits);

  /// @return nullptr: not one of ours
  [[nodiscard]] Subscriber* find(const Peer& peer);
  /// A new one. @pre find(peer) == nullptr
  /// @return nullptr when there is no place for it
  Subscriber* add(const Peer& peer, Instant now);
  void add_fixed(const Peer& peer, Bitstream version, Instant now);
  /// @return it was there; fixed ones stay.
  bool remove(const Peer& peer);
  /// Forgets who was silent for too long. @return how many
  std::size_t expire(Instant now);

  [[nodiscard]] std::span<Subscriber> all() { return subscribers_; }
  [[nodiscard]] std::span<const Subscriber> all() const { return subscribers_; }

 private:
  [[nodiscard]] bool make_place(const Peer& peer, Instant now);
  /// Of whom `may_go` is true. @return nullptr: of nobody
  template <typename MayGo>
  [[nodiscard]] const Subscriber* quietest(MayGo may_go) const;

  RegistryLimits limits_;
  std::vector<Subscriber> subscribers_;
};

}  // namespace fiducap::natnet
