// What a Vicon client may send, cut anywhere: the whole conversation, and a frame for whatever it
// asked for. First byte of an input: where to cut.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "streaming/vicon/frame_board.hpp"
#include "streaming/vicon/session.hpp"
#include "support/scene_builder.hpp"

namespace {

using namespace fiducap;
using namespace fiducap::vicon;

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static FrameBoard board(WhenInvalid::kFlag);
  static const auto frame = make_scene_frame({"arm", "drone", "rover"});
  if (size == 0) return 0;
  const std::span<const std::byte> in(reinterpret_cast<const std::byte*>(data) + 1, size - 1);
  const std::size_t cut = data[0] == 0 ? in.size() : 1 + data[0] % 64;
  ProfileTable profiles;
  const Instant now = frame->published_at;
  board.update(*frame, now);  // a new frame for every input: packets of the last one are let go
  Connection connection(profiles, now);
  (void)connection.greeting();
  std::vector<std::byte> answers;
  for (std::size_t at = 0; at < in.size(); at += cut) {
    const auto piece = in.subspan(at, std::min(cut, in.size() - at));
    if (!connection.receive(piece, now, answers)) break;
    require(answers.size() <= 2 * in.size());  // nothing is amplified
    if (!connection.wants(board.id())) continue;
    const auto bytes =
        board.packet(connection.profile(), connection.wants_statics(board.statics_version()), now);
    require(bytes->size() >= kHeaderSize && bytes->size() < 8192);
    connection.sent(board.id(), board.statics_version());
    require(!connection.wants(board.id()));
  }
  (void)connection.summary();
  (void)connection.overdue(now);
  return 0;
}
