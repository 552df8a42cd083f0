// The native server.
#include "fuzz/target.hpp"
#include "streaming/native/control_session.hpp"
#include "streaming/native/registry.hpp"
#include "support/fake_operator_api.hpp"

using namespace fiducap::native;

// Datagrams of strangers and of a subscriber. Key, address and time are fixed, so the seeds contain
// the token of this address.
FUZZ(native_fuzz, input) {
  Registry registry({4, 2, std::chrono::seconds(3)}, {1, 2}, 77);
  registry.offer_multicast({{239, 255, 42, 16}, 21601});
  registry.set_discovery(ServerCard{"host", "0.1.0", 3, 100, 21600});
  Peer peer;
  peer.port = 1000;
  const Instant now = instant_from_ns(50'000'000'000);
  for (int i = 0; i < 2; ++i) {
    const auto reply = registry.receive(input.bytes, peer, 1, now);
    // An address without a subscription never gets more than it sent.
    require(!registry.subscribers().empty() || reply.datagram.size() <= input.bytes.size());
    require(registry.subscribers().size() <= 1 && registry.profiles().size() <= 1);
  }
}

// Bytes of a stranger to the control channel, and commands of an operator.
FUZZ(native_control_fuzz, input) {
  FakeOperatorApi operator_api;
  WrongProofs wrong;
  ControlConversation conversation(std::string(32, 'c'), operator_api, wrong, {7});
  std::vector<std::byte> out;
  const std::size_t half = input.bytes.size() / 2;  // in two pieces, as a network would cut them
  const Instant now = instant_from_ns(50'000'000'000);
  if (conversation.receive(input.bytes.first(half), out, now))
    (void)conversation.receive(input.bytes.subspan(half), out, now);
  require(operator_api.changes.empty() && operator_api.mode == MapMode::kFrozen &&
          !operator_api.under_way);  // no proof by chance
  (void)decode_control_command(input.text());
}
