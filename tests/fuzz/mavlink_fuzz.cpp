// Datagrams from an autopilot's address: any bytes. Answers never grow beyond the question.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "streaming/mavlink/vehicle_link.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const auto datagram = std::as_bytes(std::span(data, size));
  mavlink::VehicleConfig config;
  config.body = "drone";
  mavlink::VehicleLink link(config);
  std::vector<std::byte> answers;
  link.receive(datagram, instant_from_ns(1'000'000'000), answers);
  if (answers.size() > size) std::abort();
  auto rest = datagram;
  while (const auto frame = mavlink::next_frame(rest)) {
    if (frame->payload.size() > size) std::abort();
    (void)mavlink::decode_timesync(*frame);
    (void)mavlink::decode_heartbeat(*frame);
  }
  return 0;
}
