// A QTM client: its conversation on each port, and discovery. The first byte chooses, the second is
// the length of the pieces.
#include <vector>

#include "fuzz/target.hpp"
#include "streaming/qualisys/session.hpp"
#include "streaming/qualisys/xml.hpp"
#include "support/scene_builder.hpp"
#include "unit/streaming/qualisys/fake_operator_api.hpp"

using namespace fiducap::qualisys;

namespace {

void converse(Dialect dialect, std::size_t piece, std::span<const std::byte> bytes) {
  static const auto frame = make_scene_frame({"arm", "drone"}, 9);
  static fiducap::qualisys::FakeOperatorApi operator_api;
  static SharedState state(QualisysConfig{}, &operator_api);
  static std::vector<std::byte> out;
  // Resets what an input may have changed; a new state would cost more than most inputs.
  operator_api = {};
  state.control = Control(&operator_api);
  state.wrong_passwords = {};
  out.clear();
  state.bodies.update(*frame->model);
  Connection connection(state, dialect, 1, "10.0.0.7", 4711);
  in_pieces(bytes, piece, [&](std::span<const std::byte> next) {
    if (!connection.receive(next, out)) return false;
    state.frames.put(frame, state.bodies);
    if (const auto profile = connection.current_of(9)) (void)state.frames.encoded(*profile);
    if (const auto profile = connection.stream_of(*frame))
      require(!state.frames.encoded(*profile)->packet.empty());
    if (const auto port = connection.udp_port()) require(*port >= kLowestUdpPort);
    return true;
  });
  (void)connection.detail();
  require(out.size() < std::size_t{5} << 20);
}

}  // namespace

FUZZ(qualisys_fuzz, input) {
  if (input.bytes.size() < 2) return;
  constexpr Dialect kDialects[] = {Dialect::kLittleEndian, Dialect::kBigEndian, Dialect::kLegacy};
  const unsigned which = input.choose(5);
  const std::size_t piece = input.choose(256);
  if (which < std::size(kDialects)) {
    converse(kDialects[which], piece, input.bytes);
  } else if (which == 3) {
    (void)decode_discover(input.bytes);
  } else {
    (void)parse_body_switches(decode_text(input.bytes));
  }
}
