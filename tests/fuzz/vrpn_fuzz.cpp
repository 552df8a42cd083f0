// A VRPN client: its conversation, with and without a cookie, and connection requests. The first
// byte chooses, the second is the length of the pieces.
#include <vector>

#include "fuzz/target.hpp"
#include "streaming/vrpn/codec.hpp"
#include "streaming/vrpn/session.hpp"
#include "support/scene_builder.hpp"

using namespace fiducap::vrpn;

namespace {

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
  in_pieces(bytes, piece, [&](std::span<const std::byte> next) {
    if (!connection.receive(next, 1'700'000'000'000'000'000, out)) return false;
    if (const auto port = connection.udp_port()) require(*port >= kLowestPort);
    (void)connection.take_notes();
    return true;
  });
  // A request has at least 24 bytes; the longest reply has 96, an explanation is sent at most four
  // times.
  require(out.size() <= described + 4 * given + 8192);
  // All replies can be decoded.
  std::span<const std::byte> rest(out);
  while (!rest.empty()) {
    const auto message = decode_message(rest);
    require(message.has_value() && message->size > 0);
    rest = rest.subspan(message->size);
  }
}

}  // namespace

FUZZ(vrpn_fuzz, input) {
  if (input.bytes.size() < 2) return;
  const unsigned which = input.choose(4);
  const std::size_t piece = input.choose(256);
  if (which == 3) {
    if (const auto port = decode_request(input.bytes)) require(*port >= kLowestPort);
  } else {
    converse(which == 0 ? Origin::kRequested : Origin::kDirect, which < 2, piece, input.bytes);
  }
}
