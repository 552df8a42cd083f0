#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "streaming/natnet/subscriber.hpp"

namespace fiducap::natnet {

struct RegistryLimits {
  int max_clients{64};
  int max_clients_per_address{16};  ///< Of others; this machine's own may take all places.
  Duration timeout{std::chrono::seconds(15)};
};

/// Who gets frames. Bounded: strangers have a few places of their own and push out each other, never a client.
class Registry final {
 public:
  static constexpr int kMaxStrangers = 16;
  static constexpr Duration kStrangerTimeout = std::chrono::seconds(3);
  /// A client silent for longer gives its place to a new one when all are taken.
  static constexpr Duration kReplaceableAfter = std::chrono::seconds(8);

  explicit Registry(const RegistryLimits& limits);

  /// @return nullptr: not one of ours
  [[nodiscard]] Subscriber* find(const Peer& peer);
  /// A new one. @pre find(peer) == nullptr
  /// @return nullptr when there is no place for it
  Subscriber* add(const Peer& peer, bool stranger, Instant now);
  void add_fixed(const Peer& peer, Bitstream version, Instant now);
  /// A stranger was heard again. @return false: no place among the clients, it stays what it is
  bool accept(Subscriber& stranger, Instant now);
  /// @return it was there; fixed ones stay.
  bool remove(const Peer& peer);
  /// Forgets who was silent for too long. @return how many of them were no strangers
  std::size_t expire(Instant now);

  [[nodiscard]] std::span<Subscriber> all() { return subscribers_; }
  [[nodiscard]] std::span<const Subscriber> all() const { return subscribers_; }

 private:
  [[nodiscard]] bool make_place(const Peer& peer, Instant now);
  void drop_oldest_stranger();

  RegistryLimits limits_;
  std::vector<Subscriber> subscribers_;
};

}  // namespace fiducap::natnet
