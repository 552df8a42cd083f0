// Datagrams to a NatNet server with clients: every request, every command, in any order.
#include "base/bytes.hpp"
#include "fuzz/memory_file.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/natnet/commands.hpp"
#include "streaming/natnet/conversation.hpp"
#include "support/fake_operator_api.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {
namespace {

constexpr std::size_t kMostDatagrams = 16;

/// First byte: bits 0-1 sender, bit 2 from another machine, bit 3 to the multicast clients' port,
/// bits 4-7 time.
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

// All state expires: every input meets a server as after its start, without the cost of one.
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
  require(conversation.subscribers().size() <= 3);
  conversation.take(world.frame, world.now);
  for (const auto& one : conversation.subscribers())
    require(conversation.frame_for(one, world.now).size() <= kMaxDatagram);
}

void play(std::span<const std::byte> input) {
  static World world;
  world.operator_api = {};
  world.now += kForgetting;
  (void)world.conversation.expire(world.now);
  require(world.conversation.subscribers().empty());
  LittleEndianReader in(input);
  for (std::size_t i = 0; i < kMostDatagrams && in.left() >= 3; ++i) {
    const Step step = read_step(in.u8());
    const std::size_t size = std::min<std::size_t>(in.u16(), in.left());
    world.now += step.passed;
    const auto answer =
        world.conversation.receive(in.bytes(size), step.from, step.channel, world.now);
    require(answer.size() <= kMaxDatagram);
    (void)world.conversation.expire(world.now);
  }
  check_frames(world);
}

void execute(const CommandRequest& request) {
  static const auto frame = make_scene_frame({"arm", "drone", "left,leg"});
  static FakeOperatorApi operator_api;
  static ServerView server{NatNetConfig{}, &operator_api,        100,
                           frame->model,   frame->model->bodies, frame};
  static CommandWords words;
  Subscriber subscriber;
  const auto answer =
      words.answer(request.text, server, {{0x7f000001, 4000}, false, {3, 1}, &subscriber});
  require(answer.datagram.size() >= kHeaderSize);
  require(answer.datagram.size() <= kHeaderSize + kMaxText);
}

}  // namespace
}  // namespace fiducap::natnet

// A list of datagrams: one byte for sender, port and time since the one before, two bytes its
// length (little-endian), and its bytes; the last may be cut.
FUZZ(natnet_fuzz, input) { natnet::play(input.bytes); }

// One datagram: the parser of requests and, behind it, the commands to a server with writable
// bodies.
FUZZ(natnet_request_fuzz, input) {
  const auto request = natnet::decode_request(input.bytes);
  if (!request) return;
  if (const auto* command = std::get_if<natnet::CommandRequest>(&*request))
    natnet::execute(*command);
}
