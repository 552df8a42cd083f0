// Datagrams from an autopilot's address. Replies are never longer.
#include "fuzz/target.hpp"
#include "streaming/mavlink/vehicle_link.hpp"

FUZZ(mavlink_fuzz, input) {
  mavlink::VehicleConfig config;
  config.body = "drone";
  mavlink::VehicleLink link(config);
  std::vector<std::byte> answers;
  link.receive(input.bytes, instant_from_ns(1'000'000'000), answers);
  require(answers.size() <= input.bytes.size());
  auto rest = input.bytes;
  while (const auto frame = mavlink::next_frame(rest)) {
    require(frame->payload.size() <= input.bytes.size());
    (void)mavlink::decode_timesync(*frame);
    (void)mavlink::decode_heartbeat(*frame);
  }
}
