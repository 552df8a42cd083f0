// Bytes of a stranger to the control channel, and commands of somebody who knows the token.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "streaming/native/control_session.hpp"
#include "support/fake_operator_api.hpp"

using namespace fiducap;
using namespace fiducap::native;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FakeOperatorApi operator_api;
  WrongProofs wrong;
  ControlConversation conversation(std::string(32, 'c'), operator_api, wrong, 7);
  std::vector<std::byte> out;
  const auto bytes = std::as_bytes(std::span(data, size));
  const std::size_t half = size / 2;  // in two pieces, as a network would cut them
  const Instant now = instant_from_ns(50'000'000'000);
  if (conversation.receive(bytes.first(half), out, now))
    (void)conversation.receive(bytes.subspan(half), out, now);
  if (!operator_api.changes.empty() || operator_api.mode != MapMode::kFrozen ||
      operator_api.under_way)
    std::abort();  // nobody proves by luck
  (void)decode_control_command(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
