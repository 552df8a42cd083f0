// What vehicles, or anybody else, send to the port where an autopilot's IMU is taken: any bytes. A
// record is its length, what it is from and how much time has passed, then its bytes.
#include <algorithm>

#include "base/bytes.hpp"
#include "capture/imu/vehicle_imu.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  LittleEndianReader in(std::as_bytes(std::span(data, size)));
  mavlink::VehicleImu vehicle(MavlinkImuConfig{});
  Instant now = instant_from_ns(1'000'000'000'000);
  std::optional<Instant> last;
  std::vector<std::byte> out;
  while (in.left() >= 3) {
    const std::size_t length = in.u8();
    const LinkPeer from{0x7f000001, static_cast<std::uint16_t>(14550 + in.u8() % 3)};
    now += Duration{std::int64_t{in.u8()} * 1'000'000};
    vehicle.receive(in.bytes(std::min(length, in.left())), from, now);
    while (const auto sample = vehicle.take()) {
      fuzz::require(!last || sample->sampled_at > *last);
      last = sample->sampled_at;
    }
    out.clear();
    vehicle.append_due(now, out);
    (void)vehicle.challenge(now, out);
    fuzz::require(out.size() < 1024);  // nobody makes it flood somebody else
    while (vehicle.take_event()) {
    }
  }
  return 0;
}
