// Everything that a VRPN client may send: its conversation, with and without a cookie, and
// connection requests. The first byte chooses, the second cuts the bytes into pieces.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "streaming/vrpn/codec.hpp"
#include "streaming/vrpn/session.hpp"
#include "support/scene_builder.hpp"

namespace {

using namespace fiducap;
using namespace fiducap::vrpn;

void require(bool holds) {
  if (!holds) std::abort();
}

void converse(Origin origin, bool with_cookie, std::size_t piece,
              std::span<const std::byte> bytes) {
  static const VrpnConfig config;
  static const SenderTable senders = [] {
    SenderTable table;
    table.update(*make_scene_frame({"arm", "drone"})->model);
    return table;
  }();
  static std::vector<std::byte> out;
  out.clear();
  Connection connection(config, senders, origin);
  if (with_cookie) require(connection.receive(connection.greeting(), 0, out).has_value());
  const std::size_t described = out.size();
  const std::size_t given = bytes.size();
  while (!bytes.empty()) {
    const auto next = bytes.first(std::min(piece, bytes.size()));
    bytes = bytes.subspan(next.size());
    if (!connection.receive(next, 1'700'000'000'000'000'000, out)) break;
    if (const auto port = connection.udp_port()) require(*port >= kLowestPort);
    (void)connection.take_notes();
  }
  // A question has 24 bytes or more; the longest answer has 96, an explanation comes four times in
  // a life.
  require(out.size() <= described + 4 * given + 8192);
  // What we say is what any peer can read.
  std::span<const std::byte> said(out);
  while (!said.empty()) {
    const auto message = decode_message(said);
    require(message.has_value() && message->size > 0);
    said = said.subspan(message->size);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(data) + 2, size - 2);
  const std::size_t piece = data[1] == 0 ? bytes.size() + 1 : data[1];
  switch (data[0] % 4) {
    case 0:
      converse(Origin::kRequested, true, piece, bytes);
      break;
    case 1:
      converse(Origin::kDirect, true, piece, bytes);
      break;
    case 2:
      converse(Origin::kDirect, false, piece, bytes);
      break;
    default:
      if (const auto port = decode_request(bytes)) require(*port >= kLowestPort);
  }
  return 0;
}
