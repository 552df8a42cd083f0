#include "capture/imu/imu_source.hpp"

#include <algorithm>
#include <cctype>
#include <utility>

#include "capture/imu/iio_source.hpp"
#include "capture/imu/line_source.hpp"
#include "capture/imu/mavlink_source.hpp"
#include "capture/imu/px4_source.hpp"
#include "capture/ros/ros_source.hpp"

namespace fiducap {

namespace {

using Opened = Expected<std::unique_ptr<SensorSource>>;

bool is_topic_name(const std::string& name) {
  const auto good = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '/'; };
  return name.size() >= 2 && name.size() <= 200 && name.front() == '/' && name.back() != '/' &&
         name.find("//") == std::string::npos && std::all_of(name.begin(), name.end(), good);
}

/// Readings of another source, turned into the body's axes and into SI units.
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

Opened open_ros(const ImuTopicConfig& config, const ImuOpening& opening) {
  auto participant = opening.join_dds();
  if (!participant) return tl::unexpected(participant.error());
  dds::RosSourceConfig ros;
  ros.imu = config.topic;
  ros.reliable = config.reliable;
  ros.synchronized = config.synchronized;
  return dds::open_ros_source(std::move(*participant), ros, {}, opening.clock);
}

Opened open_px4(const ImuTopicConfig& config, const ImuOpening& opening) {
  auto participant = opening.join_dds();
  if (!participant) return tl::unexpected(participant.error());
  return dds::open_px4_source(std::move(*participant), config, opening.clock);
}

Opened open_chosen(const ImuSourceConfig& config, const ImuOpening& opening) {
  switch (config.type) {
    case ImuSourceType::kMavlink:
      return open_mavlink_source(config.mavlink, opening.clock);
    case ImuSourceType::kIio:
      return open_iio_source(config.iio, opening.clock);
    case ImuSourceType::kPx4:
      return open_px4(config.px4, opening);
    case ImuSourceType::kRos:
      return open_ros(config.ros, opening);
    case ImuSourceType::kLine:
      break;
  }
  return open_line_source(config.line, opening.clock);
}

void check_chosen(const ImuTopicConfig& config, Checker& checker) {
  checker.require(is_topic_name(config.topic), "topic", '"' + config.topic + '"',
                  "must be a topic, e.g. /imu/data");
}

template <typename Config>
void check_chosen(const Config& config, Checker& checker) {
  config.check(checker);
}

}  // namespace

std::vector<ConfigError> ImuSourceConfig::check(const std::string& prefix) const {
  Checker checker{prefix};
  visit_imu_source(*this, [&](const auto& chosen) { check_chosen(chosen, checker); });
  const bool is_frd = type == ImuSourceType::kMavlink || type == ImuSourceType::kPx4;
  checker.require(!is_frd || axes.written != "frd", "axes", axes.written,
                  "must not be frd here: readings of MAVLink and PX4 are turned to flu already. An "
                  "autopilot that is mounted upside down has [x, -y, -z]");
  return checker.errors;
}

Opened open_imu_source(const ImuSourceConfig& config, const ImuOpening& opening) {
  auto source = open_chosen(config, opening);
  if (!source) return source;
  return std::make_unique<TurnedSource>(std::move(*source), config);
}

}  // namespace fiducap
