// Datagrams as anybody can send them, to a server with clients: every request, every command, in
// any order.
//
// The input is a list of datagrams: one byte says who sends to which port and how much time has
// passed since the one before, two bytes its length (little-endian), then come its bytes; the last
// may be cut.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "base/log.hpp"
#include "streaming/natnet/conversation.hpp"
#include "support/scene_builder.hpp"
#include "unit/streaming/natnet/fake_operator_api.hpp"

namespace fiducap::natnet {
namespace {

constexpr std::size_t kMostDatagrams = 16;

/// First byte: bits 0-1 who, bit 2 from another machine, bit 3 to the multicast clients' port, bits
/// 4-7 time.
struct Step {
  Peer from;
  Channel channel{};
  Duration passed{};
};

Step read_step(std::uint8_t how) {
  const std::uint32_t address = (how & 4) != 0 ? 0x0a000001 : 0x7f000001;
  return {{address, static_cast<std::uint16_t>(4000 + (how & 3))},
          (how & 8) != 0 ? Channel::kMulticast : Channel::kUnicast,
          Duration{std::int64_t{how >> 4} * 100'000'000}};
}

// Longer than everything is remembered: every input meets a server as it is after its start,
// without the cost of one.
constexpr Duration kForgetting = std::chrono::seconds(30);

struct World {
  std::shared_ptr<SceneFrame> frame = make_scene_frame({"arm", "drone", "left,leg"});
  FakeOperatorApi operator_api;
  Instant now = instant_from_ns(1'000'000'000'000);
  Conversation conversation{config(), frame->model, &operator_api, 100, 1, net::TrustedNetworks({}),
                            now};

  static NatNetConfig config() {
    NatNetConfig config;
    config.max_clients = 3;
    config.remote_control = RemoteControl::kAll;
    return config;
  }
};

void check_frames(World& world) {
  Conversation& conversation = world.conversation;
  FIDUCAP_ASSERT(conversation.subscribers().size() <= 3);
  conversation.take(world.frame, world.now);
  for (const auto& one : conversation.subscribers()) {
    FIDUCAP_ASSERT(conversation.frame_for(one, world.now).size() <= kMaxDatagram);
  }
}

void play(std::span<const std::byte> input) {
  static World world;
  world.operator_api = {};
  world.now += kForgetting;
  (void)world.conversation.expire(world.now);
  FIDUCAP_ASSERT(world.conversation.subscribers().empty());
  LittleEndianReader in(input);
  for (std::size_t i = 0; i < kMostDatagrams && in.left() >= 3; ++i) {
    const Step step = read_step(in.u8());
    const std::size_t size = std::min<std::size_t>(in.u16(), in.left());
    world.now += step.passed;
    const auto answer =
        world.conversation.receive(in.bytes(size), step.from, step.channel, world.now);
    FIDUCAP_ASSERT(answer.size() <= kMaxDatagram);
    (void)world.conversation.expire(world.now);
  }
  check_frames(world);
}

}  // namespace
}  // namespace fiducap::natnet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fiducap::log::set_level(fiducap::log::Level::kError);
  fiducap::natnet::play(std::as_bytes(std::span(data, size)));
  return 0;
}
