// A Vicon client: its whole conversation in pieces, and a frame as it requested. The first byte is
// the length of the pieces.
#include <vector>

#include "fuzz/target.hpp"
#include "streaming/vicon/frame_board.hpp"
#include "streaming/vicon/session.hpp"
#include "support/scene_builder.hpp"

using namespace fiducap::vicon;

FUZZ(vicon_fuzz, input) {
  static FrameBoard board(WhenInvalid::kFlag);
  static const auto frame = make_scene_frame({"arm", "drone", "rover"});
  if (input.bytes.empty()) return;
  const unsigned first = input.choose(256);
  const std::size_t piece_size = first == 0 ? 0 : 1 + first % 64;
  const Instant now = frame->published_at;
  board.update(*frame, now);  // a new frame for every input: packets of the last one are released
  ProfileTable profiles;
  Connection connection(profiles, now);
  (void)connection.greeting();
  std::vector<std::byte> answers;
  in_pieces(input.bytes, piece_size, [&](std::span<const std::byte> piece) {
    if (!connection.receive(piece, now, answers)) return false;
    require(answers.size() <= 2 * input.bytes.size());  // nothing is amplified
    if (!connection.wants(board.id())) return true;
    const auto bytes =
        board.packet(connection.profile(), connection.wants_statics(board.statics_version()), now);
    require(bytes->size() >= kHeaderSize && bytes->size() < 8192);
    connection.sent(board.id(), board.statics_version());
    require(!connection.wants(board.id()));
    return true;
  });
  (void)connection.summary();
  (void)connection.overdue(now);
}
