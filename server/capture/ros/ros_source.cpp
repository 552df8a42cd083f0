#include "capture/ros/ros_source.hpp"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <utility>

#include <fiducap_dds/ros_sensors.h>

#include "base/log.hpp"
#include "capture/reading_pairs.hpp"
#include "capture/ros_image.hpp"

namespace fiducap::dds {

bool is_topic_name(const std::string& name) {
  const auto good = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '/'; };
  return name.size() >= 2 && name.size() <= 200 && name.front() == '/' && name.back() != '/' &&
         name.find("//") == std::string::npos && std::ranges::all_of(name, good);
}

std::vector<ConfigError> RosSourceConfig::check(const std::string& prefix) const {
  Checker checker{prefix};
  checker.within("camera_info_wait_s", camera_info_wait_s, 0, 600)
      .require(!images.empty() && images.size() <= 16, "images",
               std::to_string(images.size()) + " entries", "must be 1 to 16 topics")
      .require(imu.empty() || is_topic_name(imu), "imu", '"' + imu + '"',
               "must be a topic, e.g. /imu/data")
      .require(accel.empty() || (is_topic_name(accel) && !imu.empty()), "accel", '"' + accel + '"',
               "must be a topic beside that of the gyroscope in imu, e.g. /camera/accel/sample");
  for (const auto& topic : images)
    checker.require(is_topic_name(topic), "images", '"' + topic + '"',
                    "must be topics, e.g. /camera/image_raw");
  return checker.errors;
}

std::vector<ConfigError> RosCameraConfig::check(const std::string& prefix) const {
  const std::string& image = source.images.front();
  return Checker{prefix}
      .within("camera_info_wait_s", source.camera_info_wait_s, 0, 600)
      .require(is_topic_name(image), "image", '"' + image + '"',
               "must be a topic, e.g. /camera/image_raw")
      .errors;
}

std::vector<ConfigError> check_source(const RosSourceConfig& config,
                                      const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  Checker rules{body_prefix, config.check(body_prefix + "source.")};
  rules
      .require(around.cameras.size() == config.images.size(), "cameras",
               std::to_string(around.cameras.size()) + " entries",
               "a ros source has one camera per topic in source.images")
      .require(config.imu.empty() || !around.has_imu_source, "imu_source", "{…}",
               "must not be given together with source.imu");
  return rules.errors;
}

namespace {

constexpr Duration kSlice = std::chrono::milliseconds(50);  // delay of a stop
// IMU samples are never dropped: half a second at 1 kHz is queued while an image is decoded.
constexpr int kImuDepth = 512;
constexpr int kImageDepth = 2;

std::int64_t to_ns(const builtin_interfaces_msg_dds__Time_& stamp) {
  return std::int64_t{stamp.sec} * 1'000'000'000 + stamp.nanosec;
}

Expected<Reader> make_reader(const Participant& in, const std::string& topic,
                             const dds_topic_descriptor& type, bool reliable, int depth) {
  return Reader::make(in, {"rt" + topic, &type, {}}, {reliable, false, depth, 0});
}

struct Camera {
  std::string topic;
  CameraMount mount;
  ros::GrayConversion conversion{};  ///< Of raw images …
  GrayDecoder decoder{};             ///< … and of compressed ones.
  bool warned{false};
};

class RosSource final : public TopicSource {
 public:
  RosSource(std::shared_ptr<Participant> participant, const RosSourceConfig& config,
            const Clock& clock, WaitSet arrivals)
      : TopicSource(std::move(participant), config.synchronized, clock, std::move(arrivals),
                    "the stamps of a ROS source are not of this machine's time: they are placed by "
                    "arrival now (synchronise the clocks by PTP or NTP)"),
        has_imu_(!config.imu.empty()),
        has_accel_(!config.accel.empty()) {}

  Expected<void> subscribe_all(const RosSourceConfig& config,
                               const std::vector<CameraMount>& mounts) {
    for (const std::string& topic : {config.imu, config.accel}) {
      if (topic.empty()) continue;
      if (auto done = subscribe(topic, sensor_msgs_msg_dds__Imu__desc, config.reliable, kImuDepth);
          !done)
        return done;
    }
    for (std::size_t k = 0; k < std::min(config.images.size(), mounts.size()); ++k) {
      const auto& type = ros::is_compressed(config.images[k])
                             ? sensor_msgs_msg_dds__CompressedImage__desc
                             : sensor_msgs_msg_dds__Image__desc;
      if (auto done = subscribe(config.images[k], type, config.reliable, kImageDepth); !done)
        return done;
      cameras_.push_back({config.images[k], mounts[k]});
    }
    return {};
  }

 private:
  std::optional<SensorSample> next_sample() override {
    if (auto imu = next_imu()) return imu;
    return next_image();
  }

  std::optional<SensorSample> next_imu() {
    if (!has_imu_) return std::nullopt;
    if (has_accel_) return next_pair();
    while (auto loan = readers().front().take()) {
      const auto& message = loan.as<sensor_msgs_msg_dds__Imu_>();
      const auto at = place(to_ns(message.header.stamp));
      if (!at) continue;
      const auto& w = message.angular_velocity;
      const auto& f = message.linear_acceleration;
      warn_of_zeros(f.x == 0 && f.y == 0 && f.z == 0);
      return ImuSample{*at, {w.x, w.y, w.z}, {f.x, f.y, f.z}};
    }
    return std::nullopt;
  }

  /// Once, when there was no acceleration so far: a gyroscope alone.
  void warn_of_zeros(bool is_zero) {
    constexpr int kEnough = 100;
    if (!is_zero) zeros_ = kEnough + 1;
    if (zeros_ <= kEnough && ++zeros_ == kEnough)
      log::warning("capture",
                   "the topic of the IMU has only zeros as accelerations: where the accelerometer "
                   "has a topic of its own, name it in 'accel'");
  }

  std::optional<SensorSample> next_pair() {
    while (auto loan = readers()[0].take()) {
      const auto& message = loan.as<sensor_msgs_msg_dds__Imu_>();
      const auto& w = message.angular_velocity;
      pairs_.add_gyro({to_ns(message.header.stamp), {w.x, w.y, w.z}});
    }
    while (auto loan = readers()[1].take()) {
      const auto& message = loan.as<sensor_msgs_msg_dds__Imu_>();
      const auto& f = message.linear_acceleration;
      pairs_.add_accel({to_ns(message.header.stamp), {f.x, f.y, f.z}});
    }
    while (const auto pair = pairs_.take())
      if (const auto at = place(pair->stamp_ns)) return ImuSample{*at, pair->w, pair->f};
    return std::nullopt;
  }

  /// In turn: a camera with a high rate does not block the others.
  std::optional<SensorSample> next_image() {
    for (std::size_t tried = 0; tried < cameras_.size(); ++tried) {
      const std::size_t k = turn_++ % cameras_.size();
      auto loan = readers()[k + (has_imu_ ? 1 : 0) + (has_accel_ ? 1 : 0)].take();
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
    const auto converted = cameras_[k].conversion.convert(raw, cameras_[k].mount.model, *gray);
    return finish(k, message.header.stamp, converted, std::move(gray));
  }

  std::optional<SensorSample> read(std::size_t k,
                                   const sensor_msgs_msg_dds__CompressedImage_& message) {
    auto gray = pool_.acquire();
    const CameraModel& model = cameras_[k].mount.model;
    const auto converted = cameras_[k].decoder.decode({message.data._buffer, message.data._length},
                                                      PixelSize{model.width, model.height}, *gray);
    return finish(k, message.header.stamp, converted, std::move(gray));
  }

  std::optional<SensorSample> finish(std::size_t k, const builtin_interfaces_msg_dds__Time_& stamp,
                                     const Expected<void>& converted,
                                     std::shared_ptr<GrayImage> gray) {
    if (!converted) {
      if (!std::exchange(cameras_[k].warned, true))
        log::warning("capture", cameras_[k].topic + ": " + converted.error().text() +
                                    "; such images are left out");
      return std::nullopt;
    }
    const auto at = place(to_ns(stamp));
    if (!at) return std::nullopt;
    return CameraFrame{static_cast<int>(k), *at + cameras_[k].mount.time_shift, std::move(gray)};
  }

  bool has_imu_;    ///< Its reader is the first one, …
  bool has_accel_;  ///< … that of the accelerometer the second.
  ReadingPairs pairs_;
  int zeros_{0};
  std::vector<Camera> cameras_;
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
  auto reader = make_reader(participant, topic, sensor_msgs_msg_dds__CameraInfo__desc, false, 1);
  if (!reader) return tl::unexpected(reader.error());
  auto arrivals = WaitSet::make(participant);
  if (!arrivals) return tl::unexpected(arrivals.error());
  if (auto added = arrivals->add(*reader); !added) return tl::unexpected(added.error());
  std::string why = "nothing received: is the driver running, in this domain?";
  do {
    [[maybe_unused]] const bool arrived = arrivals->wait(kSlice);
    while (auto loan = reader->take()) {
      auto model = lens_of(loan.as<sensor_msgs_msg_dds__CameraInfo_>(), ros::is_rectified(images));
      if (model) return model;
      why = model.error().text();
    }
  } while (clock.now() < deadline);
  return fail(ErrorCode::kNotFound, why + " Or describe the lens in the configuration.", topic);
}

}  // namespace

Expected<std::optional<SensorSample>> TopicSource::next(std::stop_token stop) {
  while (!stop.stop_requested()) {
    if (participant_->is_to_be_left())
      return fail(ErrorCode::kUnavailable,
                  "the DDS domain has too many participants, or this machine other network cards, "
                  "and is left for a short time");
    if (auto sample = next_sample()) return sample;
    // A message that arrives just now ends the next wait at once.
    [[maybe_unused]] const bool arrived = arrivals_.wait(kSlice);
  }
  return std::nullopt;
}

Expected<void> TopicSource::subscribe(const std::string& topic, const dds_topic_descriptor& type,
                                      bool reliable, int depth) {
  auto reader = make_reader(*participant_, topic, type, reliable, depth);
  if (!reader) return tl::unexpected(reader.error());
  readers_.push_back(std::move(*reader));
  return arrivals_.add(readers_.back());
}

std::optional<Instant> TopicSource::place(std::int64_t stamp_ns) {
  const bool by_stamp = !mapper_.by_arrival();
  const auto at = mapper_.place(stamp_ns, clock_.now(), utc_now_ns());
  if (by_stamp && mapper_.by_arrival()) log::warning("capture", by_arrival_warning_);
  return at;
}

std::int64_t utc_now_ns() {
  return std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

OpenedSource open_ros_source(std::shared_ptr<Participant> participant,
                             const RosSourceConfig& config, const std::vector<CameraMount>& cameras,
                             const Clock& clock) {
  auto arrivals = WaitSet::make(*participant);
  if (!arrivals) return tl::unexpected(arrivals.error());
  auto source =
      std::make_unique<RosSource>(std::move(participant), config, clock, std::move(*arrivals));
  return source->subscribe_all(config, cameras).map([&] { return std::move(source); });
}

Expected<void> wait_for_lenses(const Participant& participant, const RosSourceConfig& config,
                               std::vector<CameraMount>& cameras, const Clock& clock) {
  const Instant deadline = clock.now() + from_seconds(config.camera_info_wait_s);
  for (std::size_t k = 0; k < std::min(cameras.size(), config.images.size()); ++k) {
    if (cameras[k].model.width != 0) continue;
    auto model = wait_for_lens(participant, config.images[k], deadline, clock);
    if (!model) return tl::unexpected(model.error());
    cameras[k].model = *model;
    log::info("capture", config.images[k] + ": " + size_text(model->width, model->height) +
                             ", lens by camera_info");
  }
  return {};
}

}  // namespace fiducap::dds
