#include "capture/imu/imu_source.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include <fiducap_dds/px4.h>

#include "capture/ros/ros_source.hpp"

namespace fiducap {
namespace {

constexpr int kPx4Depth = 512;
// accelerometer_timestamp_relative of a reading without an accelerometer.
constexpr std::int32_t kNoAccelerometer = std::numeric_limits<std::int32_t>::max();
// Topics are versioned with their messages.
constexpr std::array<const char*, 2> kVersions{"", "_v1"};

/// frd → flu.
Eigen::Vector3d flu_from(const float (&v)[3]) { return {v[0], -v[1], -v[2]}; }

/// PX4 by uXRCE-DDS. Stamps are the agent's UTC (UXRCE_DDS_SYNCT, PX4's default), or by arrival.
class Px4Source final : public dds::TopicSource {
 public:
  Px4Source(std::shared_ptr<dds::Participant> participant, bool synchronized, const Clock& clock,
            dds::WaitSet arrivals)
      : TopicSource(std::move(participant), synchronized, clock, std::move(arrivals),
                    "PX4's stamps are not this machine's time: they are placed by arrival now. "
                    "Turn UXRCE_DDS_SYNCT on, and run the agent on this machine") {}

  Expected<void> subscribe_all(const ImuTopicConfig& config) {
    for (const char* version : kVersions) {
      if (auto done = subscribe(config.topic + version, px4_msgs_msg_dds__SensorCombined__desc,
                                config.reliable, kPx4Depth);
          !done)
        return done;
    }
    return {};
  }

 private:
  std::optional<SensorSample> next_sample() override {
    constexpr std::uint64_t kLast_us = std::uint64_t{1} << 52;  // later ones are refused
    for (dds::Reader& reader : readers()) {
      while (auto loan = reader.take()) {
        const auto& message = loan.as<px4_msgs_msg_dds__SensorCombined_>();
        if (message.accelerometer_timestamp_relative == kNoAccelerometer) continue;
        const auto at =
            place(static_cast<std::int64_t>(std::min(message.timestamp, kLast_us) * 1000));
        if (!at || (last_ && *at <= *last_)) continue;
        last_ = at;
        return ImuSample{*at, flu_from(message.gyro_rad), flu_from(message.accelerometer_m_s2)};
      }
    }
    return std::nullopt;
  }

  std::optional<Instant> last_;
};

/// Converts the readings of a source to the body's axes and SI units.
class TurnedSource final : public SensorSource {
 public:
  TurnedSource(std::unique_ptr<SensorSource> source, const ImuSourceConfig& config)
      : source_(std::move(source)),
        gyro_(config.units.gyro_scale() * config.axes.R_BS),
        accel_(config.units.accel_scale() * config.axes.R_BS) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    auto sample = source_->next(stop);
    if (!sample || !*sample) return sample;
    if (auto* imu = std::get_if<ImuSample>(&**sample)) {
      imu->w_WB_B = gyro_ * imu->w_WB_B;
      imu->f_B = accel_ * imu->f_B;
    }
    return sample;
  }

 private:
  std::unique_ptr<SensorSource> source_;
  Eigen::Matrix3d gyro_;
  Eigen::Matrix3d accel_;
};

OpenedSource open_topic(bool is_ros, const ImuTopicConfig& config, const ImuOpening& opening) {
  auto participant = opening.join_dds();
  if (!participant) return tl::unexpected(participant.error());
  if (is_ros) {
    const dds::RosSourceConfig ros{.images = {},
                                   .imu = config.topic,
                                   .accel = config.accel,
                                   .reliable = config.reliable,
                                   .synchronized = config.synchronized};
    return dds::open_ros_source(std::move(*participant), ros, {}, opening.clock);
  }
  auto arrivals = dds::WaitSet::make(**participant);
  if (!arrivals) return tl::unexpected(arrivals.error());
  auto source = std::make_unique<Px4Source>(std::move(*participant), config.synchronized,
                                            opening.clock, std::move(*arrivals));
  return source->subscribe_all(config).map([&] { return std::move(source); });
}

OpenedSource open_chosen(const ImuSourceConfig& config, const ImuOpening& opening) {
  switch (config.type) {
    case ImuSourceType::kMavlink:
      return open_mavlink_source(config.mavlink, opening.clock);
    case ImuSourceType::kIio:
      return open_iio_source(config.iio, opening.clock);
    case ImuSourceType::kPx4:
      return open_topic(false, config.px4, opening);
    case ImuSourceType::kRos:
      return open_topic(true, config.ros, opening);
    case ImuSourceType::kLine:
      break;
  }
  return open_line_source(config.line, opening.clock);
}

}  // namespace

OpenedSource open_imu_source(const ImuSourceConfig& config, const ImuOpening& opening) {
  auto source = open_chosen(config, opening);
  if (!source) return source;
  return std::make_unique<TurnedSource>(std::move(*source), config);
}

}  // namespace fiducap
