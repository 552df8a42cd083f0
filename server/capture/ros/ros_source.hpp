#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/ros/ros_config.hpp"
#include "capture/sensor_source.hpp"
#include "capture/stamp_mapper.hpp"
#include "middleware/endpoints.hpp"

namespace fiducap::dds {

/// A source that reads DDS topics. Stamps are UTC, or are placed by arrival.
class TopicSource : public SensorSource {
 public:
  /// Polls `next_sample`; never ends. @return Error while the DDS domain has too many participants
  Expected<std::optional<SensorSample>> next(std::stop_token stop) final;

 protected:
  /// @param by_arrival_warning  logged once when stamps turn out not to be UTC
  TopicSource(std::shared_ptr<Participant> participant, bool synchronized, const Clock& clock,
              WaitSet arrivals, const char* by_arrival_warning)
      : participant_(std::move(participant)),
        mapper_(synchronized),
        clock_(clock),
        by_arrival_warning_(by_arrival_warning),
        arrivals_(std::move(arrivals)) {}

  /// @return the next sample of the messages that have arrived
  virtual std::optional<SensorSample> next_sample() = 0;
  /// Appends a reader of a topic of ROS to `readers`.
  [[nodiscard]] Expected<void> subscribe(const std::string& topic, const dds_topic_descriptor& type,
                                         bool reliable, int depth);
  [[nodiscard]] std::vector<Reader>& readers() { return readers_; }
  [[nodiscard]] std::optional<Instant> place(std::int64_t stamp_ns);

 private:
  std::shared_ptr<Participant> participant_;
  StampMapper mapper_;
  const Clock& clock_;
  const char* by_arrival_warning_;
  std::vector<Reader> readers_;
  WaitSet arrivals_;  // destroyed before the readers
};

/// Images and inertial readings from topics of ROS 2. Never ends and is never lost: a driver may
/// start again. Messages with a wrong size, encoding or stamp are left out and logged once.
/// @param cameras  with their lenses, in the order of config.images
/// @return Error when a topic cannot be subscribed to
[[nodiscard]] OpenedSource open_ros_source(std::shared_ptr<Participant> participant,
                                           const RosSourceConfig& config,
                                           const std::vector<CameraMount>& cameras,
                                           const Clock& clock);

/// UTC of this machine, as in stamps of ROS.
[[nodiscard]] std::int64_t utc_now_ns();

/// Sets the lens of every camera without one (width 0) from its `camera_info`, waiting for it.
/// @return Error with the topic on which nothing usable came in time
[[nodiscard]] Expected<void> wait_for_lenses(const Participant& participant,
                                             const RosSourceConfig& config,
                                             std::vector<CameraMount>& cameras, const Clock& clock);

}  // namespace fiducap::dds
