// Samples with any stamps, in any order: through the mapping of a host's clock and into the merger,
// which gives them out in order, whatever came. A record has 10 bytes: what it is, its stamp.
#include "base/bytes.hpp"
#include "capture/sample_merger.hpp"
#include "capture/stamp_mapper.hpp"
#include "fuzz/memory_file.hpp"

namespace {

using namespace fiducap;

constexpr Duration kOldest = std::chrono::seconds(5);
constexpr Duration kAhead = std::chrono::milliseconds(50);
const Eigen::Vector3d kZero = Eigen::Vector3d::Zero();

/// IMU by time, images by time, and no image before the IMU samples of its time.
class Order final {
 public:
  void see(const SensorSample& sample) {
    const Instant at = time_of(sample);
    const bool is_imu = std::holds_alternative<ImuSample>(sample);
    auto& last = is_imu ? imu_ : image_;
    fuzz::require(!last || at >= *last);
    last = at;
  }

 private:
  std::optional<Instant> imu_, image_;
};

struct Merged {
  explicit Merged(bool has_imu) : merger(config(has_imu)) {}
  static MergerConfig config(bool has_imu) {
    MergerConfig config;
    config.has_imu = has_imu;
    config.cameras = 2;
    config.max_imu = 64;
    return config;
  }
  /// @return false: the body is lost
  bool take(SensorSample sample) {
    if (!merger.push(std::move(sample))) return false;
    while (const auto next = merger.pop()) order.see(*next);
    return true;
  }
  SampleMerger merger;
  Order order;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  Merged merged((data[0] & 1) != 0);
  StampMapper mapper((data[0] & 2) != 0);
  LittleEndianReader in(std::as_bytes(std::span(data + 1, size - 1)));
  Instant now = instant_from_ns(1'000'000'000'000);
  std::int64_t base = 0;
  while (in.left() >= 10) {
    const std::uint8_t what = in.u8();
    now += Duration{std::int64_t{in.u8()} * 1'000'000};
    const auto given = static_cast<std::int64_t>(in.u64());
    // As it came, or near the last one: otherwise nothing but wild stamps would be tried.
    const std::int64_t stamp = (what & 4) != 0 ? given : base + given % 100'000'000;
    const auto placed = mapper.place(stamp, now, to_ns(now) - 1'000'000);
    if (placed) {
      base = stamp;
      fuzz::require(*placed >= now - kOldest && *placed <= now + kAhead);
    }
    // Of a file: CsvReader lets through what is not negative and far from the end.
    const Instant of_file = instant_from_ns(stamp & ((std::int64_t{1} << 62) - 1));
    const Instant at = (what & 8) != 0 ? of_file : placed.value_or(now);
    if ((what & 16) != 0) merged.merger.set_clock_shift(what & 1, Duration{given % 200'000'000});
    const bool alive = (what & 2) != 0 ? merged.take(ImuSample{at, kZero, kZero})
                                       : merged.take(CornerFrame{what & 1, at, {}});
    if (!alive) return 0;
  }
  merged.merger.finish();
  while (const auto next = merged.merger.pop()) merged.order.see(*next);
  return 0;
}
