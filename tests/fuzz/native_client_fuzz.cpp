// Datagrams of a hostile server to the client: several in one input, each behind its length (16
// bits, little-endian).
#include "fuzz/target.hpp"
#include "src/clock_sync.hpp"
#include "src/codec.hpp"
#include "src/conversation.hpp"
#include "src/frame_assembler.hpp"
#include "src/prediction.hpp"

using namespace fiducap::sdk;

FUZZ(native_client_fuzz, input) {
  static Decoder decoder;  // keeps its memory from input to input, as in a client
  FrameAssembler assembler;
  assembler.begin(9);
  Conversation conversation(kSecond, 5, "fuzz");
  conversation.start(0);
  ClockSync clock(100);
  clock.start(0);
  Nanoseconds now = 0;
  while (input.bytes.size() >= 2) {
    std::size_t length = input.choose(256);
    length += std::size_t{256} * input.choose(256);
    if (length > input.bytes.size()) break;
    const auto* datagram = reinterpret_cast<const std::uint8_t*>(input.bytes.data());
    input.bytes = input.bytes.subspan(length);
    now += kMillisecond;
    switch (decoder.decode(datagram, length)) {
      case MessageKind::kModel:
        assembler.add(decoder.model());
        break;
      case MessageKind::kFrame:
        if (const auto* frame = assembler.add(decoder.frame())) {
          require(frame->bodies.size() <= kMaxBodies);
          (void)(frame->at_server_ns - clock.at(now, false).offset);
          for (auto body : frame->bodies) carry(body, std::chrono::milliseconds(100));
        }
        break;
      case MessageKind::kChallenge:
        conversation.on(decoder.challenge(), now);
        break;
      case MessageKind::kLease:
        (void)conversation.on(decoder.lease(), now);
        break;
      case MessageKind::kNotice:
        conversation.on(decoder.notice(), now);
        break;
      case MessageKind::kClockReply:
        clock.on(decoder.clock_reply(), now);
        break;
      case MessageKind::kDiscoveryReply:
        require(decoder.discovery_reply().body_count >= 0);
        break;
      default:
        break;
    }
    if (now >= clock.due_at()) (void)clock.ask(now);
    (void)clock.at(now, false);
    conversation.tick(now);
  }
}
