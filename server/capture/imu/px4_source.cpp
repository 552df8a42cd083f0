#include "capture/imu/px4_source.hpp"

#include <fiducap_dds/px4.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <utility>

#include "base/log.hpp"
#include "capture/ros/ros_source.hpp"
#include "capture/stamp_mapper.hpp"
#include "middleware/reader.hpp"

namespace fiducap::dds {

namespace {

constexpr Duration kPx4Slice = std::chrono::milliseconds(50);
constexpr int kPx4Depth = 512;
// accelerometer_timestamp_relative of a reading without an accelerometer.
constexpr std::int32_t kNoAccelerometer = std::numeric_limits<std::int32_t>::max();
// Once a message gets another version, its topic does, too.
constexpr std::array<const char*, 2> kVersions{"", "_v1"};

/// Forward, right, down → forward, left, up.
Eigen::Vector3d from_frd(const float (&v)[3]) { return {v[0], -v[1], -v[2]}; }

class Px4Source final : public SensorSource {
 public:
  Px4Source(std::shared_ptr<Participant> participant, bool synchronized, const Clock& clock,
            WaitSet arrivals)
      : participant_(std::move(participant)),
        mapper_(synchronized),
        clock_(clock),
        arrivals_(std::move(arrivals)) {}

  Expected<void> subscribe(const ImuTopicConfig& config) {
    readers_.reserve(kVersions.size());
    for (const char* version : kVersions) {
      auto reader =
          Reader::make(*participant_,
                       {"rt" + config.topic + version, &px4_msgs_msg_dds__SensorCombined__desc, {}},
                       {config.reliable, false, kPx4Depth, 0});
      if (!reader) return tl::unexpected(reader.error());
      readers_.push_back(std::move(*reader));
      if (auto added = arrivals_.add(readers_.back()); !added) return added;
    }
    return {};
  }

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (participant_->is_crowded())
        return fail(ErrorCode::kUnavailable, "the DDS domain is crowded and left for a moment");
      if (auto reading = next_reading()) return reading;
      [[maybe_unused]] const bool arrived = arrivals_.wait(kPx4Slice);
    }
    return std::nullopt;
  }

 private:
  std::optional<SensorSample> next_reading() {
    for (Reader& reader : readers_) {
      while (auto loan = reader.take()) {
        const auto& message = loan.as<px4_msgs_msg_dds__SensorCombined_>();
        if (message.accelerometer_timestamp_relative == kNoAccelerometer) continue;
        const auto at = place(message.timestamp);
        if (!at || (last_ && *at <= *last_)) continue;
        last_ = at;
        return ImuSample{*at, from_frd(message.gyro_rad), from_frd(message.accelerometer_m_s2)};
      }
    }
    return std::nullopt;
  }

  std::optional<Instant> place(std::uint64_t stamp_us) {
    constexpr std::uint64_t kLast_us = std::uint64_t{1} << 52;  // what is later is refused anyhow
    const auto stamp_ns = static_cast<std::int64_t>(std::min(stamp_us, kLast_us) * 1000);
    const bool by_stamp = !mapper_.by_arrival();
    const auto at = mapper_.place(stamp_ns, clock_.now(), utc_now_ns());
    if (by_stamp && mapper_.by_arrival())
      log::warning("capture",
                   "PX4's stamps are not this machine's time: they are placed by arrival now. With "
                   "UXRCE_DDS_SYNCT on, and the agent on this machine, they would be");
    return at;
  }

  std::shared_ptr<Participant> participant_;
  StampMapper mapper_;
  const Clock& clock_;
  std::vector<Reader> readers_;
  WaitSet arrivals_;  // goes before the readers
  std::optional<Instant> last_;
};

}  // namespace

Expected<std::unique_ptr<SensorSource>> open_px4_source(std::shared_ptr<Participant> participant,
                                                        const ImuTopicConfig& config,
                                                        const Clock& clock) {
  auto arrivals = WaitSet::make(*participant);
  if (!arrivals) return tl::unexpected(arrivals.error());
  auto source = std::make_unique<Px4Source>(std::move(participant), config.synchronized, clock,
                                            std::move(*arrivals));
  if (auto subscribed = source->subscribe(config); !subscribed)
    return tl::unexpected(subscribed.error());
  return source;
}

}  // namespace fiducap::dds
