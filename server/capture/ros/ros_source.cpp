#include "capture/ros/ros_source.hpp"

#include <fiducap_dds/ros_sensors.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/log.hpp"
#include "capture/ros_image.hpp"
#include "capture/stamp_mapper.hpp"
#include "middleware/reader.hpp"

namespace fiducap::dds {

namespace {

// So long a stop may take to be seen.
constexpr Duration kSlice = std::chrono::milliseconds(50);
// IMU samples are never dropped: half a second at 1 kHz may wait while an image is decoded.
constexpr int kImuDepth = 512;
constexpr int kImageDepth = 2;

std::int64_t to_ns(const builtin_interfaces_msg_dds__Time_& stamp) {
  return std::int64_t{stamp.sec} * 1'000'000'000 + stamp.nanosec;
}

Expected<Reader> subscribe(const Participant& in, const std::string& topic,
                           const dds_topic_descriptor_t& type, bool reliable, int depth) {
  return Reader::make(in, {"rt" + topic, &type, {}}, {reliable, false, depth, 0});
}

struct Camera {
  std::string topic;
  CameraMount mount;
  Reader reader;
  bool complained{false};
};

class RosSource final : public SensorSource {
 public:
  RosSource(std::shared_ptr<Participant> participant, const RosSourceConfig& config,
            const Clock& clock, WaitSet arrivals)
      : participant_(std::move(participant)),
        mapper_(config.synchronized),
        clock_(clock),
        arrivals_(std::move(arrivals)) {}

  Expected<void> subscribe_all(const RosSourceConfig& config,
                               const std::vector<CameraMount>& mounts) {
    if (!config.imu.empty()) {
      auto reader = subscribe(*participant_, config.imu, sensor_msgs_msg_dds__Imu__desc,
                              config.reliable, kImuDepth);
      if (!reader) return tl::unexpected(reader.error());
      imu_.emplace(std::move(*reader));
      if (auto added = arrivals_.add(*imu_); !added) return added;
    }
    for (std::size_t k = 0; k < std::min(config.images.size(), mounts.size()); ++k) {
      const auto& type = ros::is_compressed(config.images[k])
                             ? sensor_msgs_msg_dds__CompressedImage__desc
                             : sensor_msgs_msg_dds__Image__desc;
      auto reader = subscribe(*participant_, config.images[k], type, config.reliable, kImageDepth);
      if (!reader) return tl::unexpected(reader.error());
      if (auto added = arrivals_.add(*reader); !added) return added;
      cameras_.push_back({config.images[k], mounts[k], std::move(*reader)});
    }
    return {};
  }

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (participant_->is_crowded())
        return fail(ErrorCode::kUnavailable, "the DDS domain is crowded and left for a moment");
      if (auto imu = next_imu()) return imu;
      if (auto image = next_image()) return image;
      // Nothing is lost when a message comes just now: the next wait ends at once.
      [[maybe_unused]] const bool arrived = arrivals_.wait(kSlice);
    }
    return std::nullopt;
  }

 private:
  std::optional<SensorSample> next_imu() {
    if (!imu_) return std::nullopt;
    while (auto loan = imu_->take()) {
      const auto& message = loan.as<sensor_msgs_msg_dds__Imu_>();
      const auto at = place(message.header.stamp);
      if (!at) continue;
      const auto& w = message.angular_velocity;
      const auto& f = message.linear_acceleration;
      return ImuSample{*at, {w.x, w.y, w.z}, {f.x, f.y, f.z}};
    }
    return std::nullopt;
  }

  /// In turn, so that a camera that floods leaves room for the others.
  std::optional<SensorSample> next_image() {
    for (std::size_t tried = 0; tried < cameras_.size(); ++tried) {
      const std::size_t k = turn_++ % cameras_.size();
      auto loan = cameras_[k].reader.take();
      if (!loan) continue;
      auto frame = ros::is_compressed(cameras_[k].topic)
                       ? read(k, loan.as<sensor_msgs_msg_dds__CompressedImage_>())
                       : read(k, loan.as<sensor_msgs_msg_dds__Image_>());
      if (frame) return frame;
    }
    return std::nullopt;
  }

  std::optional<SensorSample> read(std::size_t k, const sensor_msgs_msg_dds__Image_& message) {
    const ros::RawImage raw{message.width,
                            message.height,
                            message.encoding == nullptr ? "" : message.encoding,
                            message.is_bigendian != 0,
                            message.step,
                            {message.data._buffer, message.data._length}};
    auto gray = pool_.acquire();
    const auto converted = ros::to_gray(raw, cameras_[k].mount.model, *gray);
    return finish(k, message.header.stamp, converted, std::move(gray));
  }

  std::optional<SensorSample> read(std::size_t k,
                                   const sensor_msgs_msg_dds__CompressedImage_& message) {
    auto gray = pool_.acquire();
    const auto converted = ros::decode_gray({message.data._buffer, message.data._length},
                                            cameras_[k].mount.model, *gray);
    return finish(k, message.header.stamp, converted, std::move(gray));
  }

  std::optional<SensorSample> finish(std::size_t k, const builtin_interfaces_msg_dds__Time_& stamp,
                                     const Expected<void>& converted,
                                     std::shared_ptr<GrayImage> gray) {
    if (!converted) {
      if (!std::exchange(cameras_[k].complained, true)) {
        log::warning("capture", cameras_[k].topic + ": " + converted.error().text() +
                                    "; such images are left out");
      }
      return std::nullopt;
    }
    const auto at = place(stamp);
    if (!at) return std::nullopt;
    return CameraFrame{static_cast<int>(k), *at + cameras_[k].mount.time_shift, std::move(gray)};
  }

  std::optional<Instant> place(const builtin_interfaces_msg_dds__Time_& stamp) {
    const bool by_stamp = !mapper_.by_arrival();
    const auto at = mapper_.place(to_ns(stamp), clock_.now(), utc_now_ns());
    if (by_stamp && mapper_.by_arrival()) {
      log::warning(
          "capture",
          "the stamps of a ROS source are not of this machine's time (PTP or NTP would help): they "
          "are placed by arrival now");
    }
    return at;
  }

  std::shared_ptr<Participant> participant_;
  StampMapper mapper_;
  const Clock& clock_;
  std::optional<Reader> imu_;
  std::vector<Camera> cameras_;
  WaitSet arrivals_;  // goes before the readers
  GrayImagePool pool_;
  std::size_t turn_{0};
};

Expected<CameraModel> lens_of(const sensor_msgs_msg_dds__CameraInfo_& message, bool of_rectified) {
  ros::CameraInfo info{message.width,
                       message.height,
                       message.distortion_model == nullptr ? "" : message.distortion_model,
                       {message.d._buffer, message.d._length},
                       {},
                       {},
                       message.binning_x,
                       message.binning_y,
                       message.roi.x_offset,
                       message.roi.y_offset};
  std::copy_n(message.k, info.K.size(), info.K.begin());
  std::copy_n(message.p, info.P.size(), info.P.begin());
  return ros::camera_model(info, of_rectified);
}

/// The first usable lens of these images before `deadline`.
Expected<CameraModel> wait_for_lens(const Participant& participant, const std::string& images,
                                    Instant deadline, const Clock& clock) {
  const std::string topic = ros::camera_info_topic(images);
  auto reader = subscribe(participant, topic, sensor_msgs_msg_dds__CameraInfo__desc, false, 1);
  if (!reader) return tl::unexpected(reader.error());
  auto arrivals = WaitSet::make(participant);
  if (!arrivals) return tl::unexpected(arrivals.error());
  if (auto added = arrivals->add(*reader); !added) return tl::unexpected(added.error());
  std::string why = "nothing came: is the driver running, in this domain?";
  do {
    [[maybe_unused]] const bool arrived = arrivals->wait(kSlice);
    while (auto loan = reader->take()) {
      auto model = lens_of(loan.as<sensor_msgs_msg_dds__CameraInfo_>(), ros::is_rectified(images));
      if (model) return model;
      why = model.error().text();
    }
  } while (clock.now() < deadline);
  return fail(ErrorCode::kNotFound, why + " Or describe the camera's lens in the configuration.",
              topic);
}

}  // namespace

std::int64_t utc_now_ns() {
  return std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

Expected<std::unique_ptr<SensorSource>> open_ros_source(std::shared_ptr<Participant> participant,
                                                        const RosSourceConfig& config,
                                                        const std::vector<CameraMount>& cameras,
                                                        const Clock& clock) {
  auto arrivals = WaitSet::make(*participant);
  if (!arrivals) return tl::unexpected(arrivals.error());
  auto source =
      std::make_unique<RosSource>(std::move(participant), config, clock, std::move(*arrivals));
  if (auto subscribed = source->subscribe_all(config, cameras); !subscribed)
    return tl::unexpected(subscribed.error());
  return source;
}

Expected<void> ask_for_lenses(const Participant& participant, const RosSourceConfig& config,
                              std::vector<CameraMount>& cameras, const Clock& clock) {
  const Instant deadline = clock.now() + from_seconds(config.camera_info_wait_s);
  for (std::size_t k = 0; k < std::min(cameras.size(), config.images.size()); ++k) {
    if (cameras[k].model.width != 0) continue;
    auto model = wait_for_lens(participant, config.images[k], deadline, clock);
    if (!model) return tl::unexpected(model.error());
    cameras[k].model = *model;
    log::info("capture", config.images[k] + ": " + std::to_string(model->width) + " x " +
                             std::to_string(model->height) + ", lens by camera_info");
  }
  return {};
}

}  // namespace fiducap::dds
