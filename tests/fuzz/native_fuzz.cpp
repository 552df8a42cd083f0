// Datagrams of strangers and of a subscriber to the native server's conversation. Key, address and
// time are fixed, so the seeds know the token that this address would be given.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "streaming/native/registry.hpp"

using namespace fiducap;
using namespace fiducap::native;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Registry registry({4, 2, std::chrono::seconds(3)}, {1, 2}, 77);
  registry.offer_multicast({{239, 255, 42, 16}, 21601});
  registry.set_discovery(ServerCard{"host", "0.1.0", 3, 100, 21600});
  Peer peer;
  peer.port = 1000;
  const Instant now = instant_from_ns(50'000'000'000);
  const auto bytes = std::as_bytes(std::span(data, size));
  for (int i = 0; i < 2; ++i) {
    const auto reply = registry.receive(bytes, peer, 1, now);
    // An address that is not a subscriber's never gets more than it sent.
    if (registry.subscribers().empty() && reply.datagram.size() > size) std::abort();
    if (registry.subscribers().size() > 1 || registry.profiles().size() > 1) std::abort();
  }
  return 0;
}
