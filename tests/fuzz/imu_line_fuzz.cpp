// What comes over a serial line or a UDP port from a microcontroller: any bytes, in any pieces. The
// first byte says how long the pieces are; each comes a millisecond after the one before.
#include <algorithm>

#include "capture/imu/line_receiver.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  if (size == 0) return 0;
  const std::size_t piece = 1 + data[0];
  auto rest = std::as_bytes(std::span(data + 1, size - 1));
  LineReceiver receiver;
  Instant now = instant_from_ns(1'000'000'000'000);
  std::optional<Instant> last;
  std::uint64_t taken = 0;
  while (!rest.empty()) {
    const std::size_t length = std::min(piece, rest.size());
    receiver.receive(rest.first(length), now);
    rest = rest.subspan(length);
    now += std::chrono::milliseconds(1);
    while (const auto sample = receiver.take()) {
      fuzz::require(!last || sample->sampled_at > *last);
      fuzz::require(sample->w_WB_B.allFinite() && sample->f_B.allFinite());
      last = sample->sampled_at;
      ++taken;
    }
  }
  fuzz::require(taken == receiver.counts().readings);
  return 0;
}
