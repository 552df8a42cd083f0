// Samples of sensors: with any stamps, and as bytes of devices.
#include <optional>
#include <vector>

#include "base/bytes.hpp"
#include "capture/imu/line_receiver.hpp"
#include "capture/imu/vehicle_imu.hpp"
#include "capture/sample_merger.hpp"
#include "capture/stamp_mapper.hpp"
#include "fuzz/memory_file.hpp"

namespace {

constexpr Duration kOldest = std::chrono::seconds(5);
constexpr Duration kAhead = std::chrono::milliseconds(50);
const Eigen::Vector3d kZero = Eigen::Vector3d::Zero();

struct Merged {
  explicit Merged(bool has_imu) : merger(config(has_imu)) {}
  static MergerConfig config(bool has_imu) {
    MergerConfig config;
    config.has_imu = has_imu;
    config.cameras = 2;
    config.max_imu = 64;
    return config;
  }
  /// Output is in order: IMU samples by time, images by time.
  void drain() {
    while (const auto next = merger.pop()) {
      auto& last = std::holds_alternative<ImuSample>(*next) ? last_imu : last_image;
      require(!last || time_of(*next) >= *last);
      last = time_of(*next);
    }
  }
  /// @return false: the body is lost
  bool take(SensorSample sample) {
    if (!merger.push(std::move(sample))) return false;
    drain();
    return true;
  }
  SampleMerger merger;
  std::optional<Instant> last_imu, last_image;
};

}  // namespace

// Through the mapping of a host's clock and into the merger. A record has 10 bytes: its kind, its
// stamp.
FUZZ(sensor_stamps_fuzz, input) {
  if (input.bytes.empty()) return;
  const unsigned how = input.choose(256);
  Merged merged((how & 1) != 0);
  StampMapper mapper((how & 2) != 0);
  LittleEndianReader in(input.bytes);
  Instant now = instant_from_ns(1'000'000'000'000);
  std::int64_t base = 0;
  while (in.left() >= 10) {
    const std::uint8_t what = in.u8();
    now += Duration{std::int64_t{in.u8()} * 1'000'000};
    const auto given = static_cast<std::int64_t>(in.u64());
    // As given, or near the last one: otherwise only wild stamps would be tried.
    const std::int64_t stamp = (what & 4) != 0 ? given : base + given % 100'000'000;
    const auto placed = mapper.place(stamp, now, to_ns(now) - 1'000'000);
    if (placed) {
      base = stamp;
      require(*placed >= now - kOldest && *placed <= now + kAhead);
    }
    // Of a file: CsvReader accepts stamps that are not negative and far from the end.
    const Instant of_file = instant_from_ns(stamp & ((std::int64_t{1} << 62) - 1));
    const Instant at = (what & 8) != 0 ? of_file : placed.value_or(now);
    if ((what & 16) != 0) merged.merger.set_clock_shift(what & 1, Duration{given % 200'000'000});
    const bool alive = (what & 2) != 0 ? merged.take(ImuSample{at, kZero, kZero})
                                       : merged.take(CornerFrame{what & 1, at, {}});
    if (!alive) return;
  }
  merged.merger.finish();
  merged.drain();
}

// A microcontroller on a serial line or a UDP port. The first byte is the length of the pieces,
// which arrive a millisecond apart.
FUZZ(imu_line_fuzz, input) {
  const std::size_t piece_size = 1 + input.choose(256);
  LineReceiver receiver;
  Instant now = instant_from_ns(1'000'000'000'000);
  std::optional<Instant> last;
  std::uint64_t taken = 0;
  in_pieces(input.bytes, piece_size, [&](std::span<const std::byte> piece) {
    receiver.receive(piece, now);
    now += std::chrono::milliseconds(1);
    while (const auto sample = receiver.take()) {
      require(!last || sample->sampled_at > *last);
      require(sample->w_WB_B.allFinite() && sample->f_B.allFinite());
      last = sample->sampled_at;
      ++taken;
    }
    return true;
  });
  require(taken == receiver.counts().readings);
}

// Datagrams to the port of an autopilot's IMU. A record is its length, its sender, the time since
// the one before, and its bytes.
FUZZ(mavlink_imu_fuzz, input) {
  LittleEndianReader in(input.bytes);
  mavlink::VehicleImu vehicle(MavlinkImuConfig{});
  Instant now = instant_from_ns(1'000'000'000'000);
  std::optional<Instant> last;
  std::vector<std::byte> out;
  while (in.left() >= 3) {
    const std::size_t length = in.u8();
    const net::Peer from{0x7f000001, static_cast<std::uint16_t>(14550 + in.u8() % 3)};
    now += Duration{std::int64_t{in.u8()} * 1'000'000};
    vehicle.receive(in.bytes(std::min(length, in.left())), from, now);
    while (const auto sample = vehicle.take()) {
      require(!last || sample->sampled_at > *last);
      last = sample->sampled_at;
    }
    out.clear();
    vehicle.append_due(now, out);
    (void)vehicle.challenge(now, out);
    require(out.size() < 1024);  // no amplification
    while (vehicle.take_event()) {
    }
  }
}
