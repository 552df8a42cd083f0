// Everything that a QTM client may send: its conversation on each port, and discovery. The first
// byte chooses, the second cuts the bytes into pieces.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "streaming/qualisys/session.hpp"
#include "streaming/qualisys/xml.hpp"
#include "support/scene_builder.hpp"
#include "unit/streaming/qualisys/fake_operator_api.hpp"

namespace {

using namespace fiducap;
using namespace fiducap::qualisys;

void require(bool holds) {
  if (!holds) std::abort();
}

void converse(Dialect dialect, std::size_t piece, std::span<const std::byte> bytes) {
  static const auto frame = make_scene_frame({"arm", "drone"}, 9);
  static FakeOperatorApi operator_api;
  static SharedState room(QualisysConfig{}, &operator_api);
  static std::vector<std::byte> out;
  // What an input may have changed; the rest of the room costs more than most inputs do.
  operator_api = {};
  room.control = Control(&operator_api);
  room.wrong_passwords = {};
  out.clear();
  room.bodies.update(*frame->model);
  Connection connection(room, dialect, 1, "10.0.0.7", 4711);
  EncodedFrame encoded;
  while (!bytes.empty()) {
    const auto next = bytes.first(std::min(piece, bytes.size()));
    bytes = bytes.subspan(next.size());
    if (!connection.receive(next, out)) break;
    room.frames.put(frame, room.bodies);
    if (const auto profile = connection.current_of(9)) (void)room.frames.encoded(*profile);
    if (const auto profile = connection.stream_of(*frame)) {
      require(!room.frames.encoded(*profile)->packet.empty());
    }
    if (const auto port = connection.udp_port()) require(*port >= kLowestUdpPort);
  }
  (void)connection.detail();
  require(out.size() < std::size_t{5} << 20);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(data) + 2, size - 2);
  const std::size_t piece = data[1] == 0 ? bytes.size() + 1 : data[1];
  switch (data[0] % 5) {
    case 0:
      converse(Dialect::kLittleEndian, piece, bytes);
      break;
    case 1:
      converse(Dialect::kBigEndian, piece, bytes);
      break;
    case 2:
      converse(Dialect::kLegacy, piece, bytes);
      break;
    case 3:
      (void)decode_discover(bytes);
      break;
    default:
      (void)parse_body_switches(decode_text(bytes));
  }
  return 0;
}
