#include "capture/import/import_parts.hpp"

#include <utility>

#include "base/log.hpp"
#include "capture/import/imu_csv.hpp"
#include "capture/import/ros_messages.hpp"
#include "capture/reading_pairs.hpp"

namespace fiducap {
namespace {

constexpr int kImu = -1;    // without a topic kAccel: gyroscope and accelerometer
constexpr int kAccel = -2;  // the accelerometer of a gyroscope

/// A camera, or one of these.
struct TakenTopic {
  std::string name;
  std::string type;
  int camera{kImu};
  int used_bits{8};
};

class LogSource final : public SensorSource {
 public:
  LogSource(std::unique_ptr<MessageLog> log, std::vector<TakenTopic> taken,
            std::vector<CameraMount> cameras, const ImportOptions& options)
      : log_(std::move(log)),
        taken_(std::move(taken)),
        cameras_(std::move(cameras)),
        log_stamps_(options.log_stamps),
        imu_offset_(options.imu_offset),
        conversions_(cameras_.size()),
        decoders_(cameras_.size()),
        warned_(cameras_.size(), false) {
    for (const TakenTopic& topic : taken_) {
      if (topic.camera < 0) continue;
      conversions_[static_cast<std::size_t>(topic.camera)] = ros::GrayConversion(topic.used_bits);
      decoders_[static_cast<std::size_t>(topic.camera)] = GrayDecoder(topic.used_bits);
    }
  }

  /// The readings of gyroscope and accelerometer, which may follow each other in the log.
  Expected<void> join(MessageLog& messages) {
    std::vector<VectorReading> gyro;
    std::vector<VectorReading> accel;
    LoggedMessage message;
    for (auto more = messages.next(message);; more = messages.next(message)) {
      if (!more) return tl::unexpected(more.error());
      if (!*more) break;
      const TakenTopic* topic = taken(message.topic, messages);
      if (topic == nullptr || topic->camera >= 0) continue;
      const auto read = ros::read_imu(messages.topics()[message.topic].format, message.bytes);
      const auto at = read ? stamp(read->stamp_ns, message.logged_ns) : std::nullopt;
      if (!at) continue;
      auto& readings = topic->camera == kAccel ? accel : gyro;
      readings.push_back({to_ns(*at), topic->camera == kAccel ? read->f : read->w});
    }
    by_topic_.clear();
    put_in_order(gyro);
    put_in_order(accel);
    ImuPairs pairs = pair_readings(gyro, accel);
    if (pairs.alone > 0)
      log::warning("import", std::to_string(pairs.alone) +
                                 " readings of the gyroscope without an accelerometer within 0.1 s "
                                 "around them are left out");
    if (pairs.samples.empty())
      return fail(ErrorCode::kInvalid, "gyroscope and accelerometer have no time in common");
    joined_ = std::move(pairs.samples);
    return {};
  }

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    if (next_joined_ < joined_.size()) {
      ImuSample sample = joined_[next_joined_++];
      sample.sampled_at += imu_offset_;
      return sample;
    }
    LoggedMessage message;
    while (!stop.stop_requested()) {
      const auto more = log_->next(message);
      if (!more) return tl::unexpected(more.error());
      if (!*more) return std::nullopt;
      const TakenTopic* topic = taken(message.topic, *log_);
      if (topic == nullptr || (topic->camera < 0 && !joined_.empty())) continue;
      const LoggedTopic& logged = log_->topics()[message.topic];
      auto sample = topic->camera < 0 ? imu(logged, message) : image(*topic, logged, message);
      if (sample) return sample;
    }
    return std::nullopt;
  }

 private:
  const TakenTopic* taken(std::size_t topic, const MessageLog& log) {
    while (by_topic_.size() <= topic) {
      const LoggedTopic& logged = log.topics()[by_topic_.size()];
      const TakenTopic* found = nullptr;
      for (const TakenTopic& one : taken_)
        if (one.name == printable_name(logged.name) && one.type == printable_name(logged.type))
          found = &one;
      by_topic_.push_back(found);
    }
    return by_topic_[topic];
  }

  /// @return nullopt: no stamp
  [[nodiscard]] std::optional<Instant> stamp(std::int64_t header_ns, std::int64_t logged_ns) const {
    const std::int64_t ns = log_stamps_ ? logged_ns : header_ns;
    if (ns <= 0) return std::nullopt;
    return instant_from_ns(ns);
  }

  [[nodiscard]] std::optional<SensorSample> imu(const LoggedTopic& topic,
                                                const LoggedMessage& message) const {
    const auto read = ros::read_imu(topic.format, message.bytes);
    if (!read) return std::nullopt;
    const auto at = stamp(read->stamp_ns, message.logged_ns);
    if (!at) return std::nullopt;
    return ImuSample{*at + imu_offset_, read->w, read->f};
  }

  std::optional<SensorSample> image(const TakenTopic& taken, const LoggedTopic& topic,
                                    const LoggedMessage& message) {
    const auto k = static_cast<std::size_t>(taken.camera);
    const CameraMount& mount = cameras_[k];
    auto gray = pool_.acquire();
    std::int64_t header_ns = 0;
    const auto decoded = decode(topic, message, k, header_ns, *gray);
    const auto at = stamp(header_ns, message.logged_ns);
    if (decoded && at) return CameraFrame{taken.camera, *at + mount.time_shift, std::move(gray)};
    if (!decoded && !warned_[k]) {
      warned_[k] = true;
      log::warning("import",
                   taken.name + ": " + decoded.error().text() + "; such images are left out");
    }
    return std::nullopt;
  }

  Expected<void> decode(const LoggedTopic& topic, const LoggedMessage& message, std::size_t k,
                        std::int64_t& header_ns, GrayImage& gray) {
    const CameraModel& model = cameras_[k].model;
    const bool is_raw = ros_type(topic) == RosType::kImage;
    const auto read = is_raw ? ros::read_image(topic.format, message.bytes)
                             : ros::read_compressed(topic.format, message.bytes);
    if (!read) return tl::unexpected(read.error());
    header_ns = read->stamp_ns;
    return is_raw
               ? conversions_[k].convert(read->image, model, gray)
               : decoders_[k].decode(read->image.data, PixelSize{model.width, model.height}, gray);
  }

  std::unique_ptr<MessageLog> log_;
  std::vector<TakenTopic> taken_;
  std::vector<const TakenTopic*> by_topic_;
  std::vector<CameraMount> cameras_;
  bool log_stamps_;
  Duration imu_offset_;
  std::vector<ImuSample> joined_;  ///< Of two topics.
  std::size_t next_joined_{0};
  std::vector<ros::GrayConversion> conversions_;
  std::vector<GrayDecoder> decoders_;
  std::vector<bool> warned_;
  GrayImagePool pool_;
};

class LogImport final : public ImportSource {
 public:
  LogImport(std::vector<std::string> paths, const ImportOptions& options, LogSurvey survey)
      : paths_(std::move(paths)), options_(options), survey_(std::move(survey)) {}

  const std::vector<FoundStream>& streams() const override { return survey_.streams; }
  std::vector<std::string> others() const override { return survey_.others; }
  std::vector<std::string> remarks() const override { return survey_.remarks; }

  OpenedSource open(const ImportChoice& choice, const std::vector<CameraMount>& cameras) override {
    auto log = open_message_logs(paths_);
    if (!log) return tl::unexpected(log.error());
    std::vector<TakenTopic> taken;
    for (std::size_t k = 0; k < choice.images.size(); ++k)
      taken.push_back(topic_of(choice.images[k], static_cast<int>(k)));
    if (choice.imu) taken.push_back(topic_of(*choice.imu, kImu));
    if (choice.accel) taken.push_back(topic_of(*choice.accel, kAccel));
    auto source = std::make_unique<LogSource>(std::move(*log), std::move(taken), cameras, options_);
    if (!choice.accel) return source;
    const auto readings = open_message_logs(paths_);
    if (!readings) return tl::unexpected(readings.error());
    return source->join(**readings).map([&] { return std::move(source); });
  }

 private:
  [[nodiscard]] TakenTopic topic_of(std::size_t stream, int camera) const {
    const FoundStream& found = survey_.streams[stream];
    return {found.name, found.type, camera, found.used_bits};
  }

  std::vector<std::string> paths_;
  ImportOptions options_;
  LogSurvey survey_;
};

}  // namespace

OpenedImport open_log_import(const std::vector<std::string>& paths, const ImportOptions& options,
                             const ImportProgress& progress) {
  auto log = open_message_logs(paths);
  if (!log) return tl::unexpected(log.error());
  auto survey = survey_log(**log, options.log_stamps, progress);
  if (!survey) return tl::unexpected(survey.error());
  return std::make_unique<LogImport>(paths, options, std::move(*survey));
}

}  // namespace fiducap
