#include "capture/import/import_parts.hpp"

#include <utility>

#include "base/log.hpp"
#include "capture/import/ros_messages.hpp"

namespace fiducap {
namespace {

struct TakenTopic {
  std::string name;
  std::string type;
  int camera{-1};  ///< −1: the IMU.
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
        warned_(cameras_.size(), false) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    LoggedMessage message;
    while (!stop.stop_requested()) {
      const auto more = log_->next(message);
      if (!more) return tl::unexpected(more.error());
      if (!*more) return std::nullopt;
      const TakenTopic* topic = taken(message.topic);
      if (topic == nullptr) continue;
      const LoggedTopic& logged = log_->topics()[message.topic];
      auto sample = topic->camera < 0 ? imu(logged, message) : image(*topic, logged, message);
      if (sample) return sample;
    }
    return std::nullopt;
  }

 private:
  const TakenTopic* taken(std::size_t topic) {
    while (by_topic_.size() <= topic) {
      const LoggedTopic& logged = log_->topics()[by_topic_.size()];
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

  std::optional<SensorSample> imu(const LoggedTopic& topic, const LoggedMessage& message) const {
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
    const auto decoded = decode(topic, message, mount.model, header_ns, *gray);
    const auto at = stamp(header_ns, message.logged_ns);
    if (decoded && at) return CameraFrame{taken.camera, *at + mount.time_shift, std::move(gray)};
    if (!decoded && !warned_[k]) {
      warned_[k] = true;
      log::warning("import",
                   taken.name + ": " + decoded.error().text() + "; such images are left out");
    }
    return std::nullopt;
  }

  static Expected<void> decode(const LoggedTopic& topic, const LoggedMessage& message,
                               const CameraModel& model, std::int64_t& header_ns, GrayImage& gray) {
    const bool is_raw = ros_type(topic) == RosType::kImage;
    const auto read = is_raw ? ros::read_image(topic.format, message.bytes)
                             : ros::read_compressed(topic.format, message.bytes);
    if (!read) return tl::unexpected(read.error());
    header_ns = read->stamp_ns;
    return is_raw ? ros::to_gray(read->image, model, gray)
                  : ros::decode_gray(read->image.data, model, gray);
  }

  std::unique_ptr<MessageLog> log_;
  std::vector<TakenTopic> taken_;
  std::vector<const TakenTopic*> by_topic_;
  std::vector<CameraMount> cameras_;
  bool log_stamps_;
  Duration imu_offset_;
  std::vector<bool> warned_;
  GrayImagePool pool_;
};

class LogImport final : public ImportSource {
 public:
  LogImport(std::string path, const ImportOptions& options, LogSurvey survey)
      : path_(std::move(path)), options_(options), survey_(std::move(survey)) {}

  const std::vector<FoundStream>& streams() const override { return survey_.streams; }
  std::vector<std::string> others() const override { return survey_.others; }
  std::vector<std::string> remarks() const override { return survey_.remarks; }

  OpenedSource open(const ImportChoice& choice, const std::vector<CameraMount>& cameras) override {
    auto log = open_message_log(path_);
    if (!log) return tl::unexpected(log.error());
    std::vector<TakenTopic> taken;
    for (std::size_t k = 0; k < choice.images.size(); ++k)
      taken.push_back(topic_of(choice.images[k], static_cast<int>(k)));
    if (choice.imu) taken.push_back(topic_of(*choice.imu, -1));
    return std::make_unique<LogSource>(std::move(*log), std::move(taken), cameras, options_);
  }

 private:
  [[nodiscard]] TakenTopic topic_of(std::size_t stream, int camera) const {
    return {survey_.streams[stream].name, survey_.streams[stream].type, camera};
  }

  std::string path_;
  ImportOptions options_;
  LogSurvey survey_;
};

}  // namespace

OpenedImport open_log_import(const std::string& path, const ImportOptions& options,
                             const ImportProgress& progress) {
  auto log = open_message_log(path);
  if (!log) return tl::unexpected(log.error());
  auto survey = survey_log(**log, options.log_stamps, progress);
  if (!survey) return tl::unexpected(survey.error());
  return std::make_unique<LogImport>(path, options, std::move(*survey));
}

}  // namespace fiducap
