#pragma once

#include <random>

#include "middleware/net/peer.hpp"
#include "support/faulty_link.hpp"

namespace fiducap {

/// A client and a server over datagrams that are lost, doubled, delayed and cut by seed, in virtual
/// time.
class DatagramNetwork {
 public:
  virtual ~DatagramNetwork() = default;
  void heal() {
    up_.set({});
    down_.set({});
  }
  /// @return virtual time until the client has `wanted` more whole frames, at most `timeout`
  Duration wait_for_frames(int wanted, Duration timeout) {
    const Instant begin = now_;
    const int before = frames_;
    while (frames_ < before + wanted && now_ - begin < timeout) step();
    return now_ - begin;
  }
  [[nodiscard]] int frames() const { return frames_; }

 protected:
  explicit DatagramNetwork(std::uint32_t seed) : random_(seed) {}
  virtual void step() = 0;

  std::mt19937 random_;
  FaultyLink up_{random_, LinkFaults::drawn(random_)};
  FaultyLink down_{random_, LinkFaults::drawn(random_)};
  Instant now_ = instant_from_ns(1'000'000'000'000);
  net::Peer peer_{0x0a000007, 40001};  ///< The client.
  int frames_{0};                      ///< That the client received.
};

}  // namespace fiducap
