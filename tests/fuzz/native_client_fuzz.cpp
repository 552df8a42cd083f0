// Datagrams of a hostile server to the client: several in one input, each behind its length (16
// bits, little-endian).
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "src/clock_sync.hpp"
#include "src/codec.hpp"
#include "src/conversation.hpp"
#include "src/frame_assembler.hpp"
#include "src/prediction.hpp"

using namespace fiducap::sdk;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Decoder decoder;  // keeps its memory from input to input, as in a client
  FrameAssembler assembler;
  assembler.begin(9);
  Conversation conversation(kSecond, 5, "fuzz");
  conversation.start(0);
  ClockSync clock(100);
  clock.start(0);
  Nanoseconds now = 0;
  while (size >= 2) {
    const std::size_t length = std::size_t{data[0]} | std::size_t{data[1]} << 8;
    data += 2;
    size -= 2;
    if (length > size) break;
    now += kMillisecond;
    switch (decoder.decode(data, length)) {
      case MessageKind::kModel:
        assembler.add(decoder.model());
        break;
      case MessageKind::kFrame:
        if (const auto* frame = assembler.add(decoder.frame())) {
          if (frame->bodies.size() > kMaxBodies) std::abort();
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
        if (decoder.discovery_reply().body_count < 0) std::abort();
        break;
      default:
        break;
    }
    if (now >= clock.due_at()) (void)clock.ask(now);
    (void)clock.at(now, false);
    conversation.tick(now);
    data += length;
    size -= length;
  }
  return 0;
}
