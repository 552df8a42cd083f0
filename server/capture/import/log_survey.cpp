#include <array>

#include "capture/gray_image.hpp"
#include "capture/import/import_parts.hpp"
#include "capture/import/ros_messages.hpp"

namespace fiducap {
namespace {

constexpr int kLargestSide = 65535;
constexpr std::int64_t kMostPixels = 1 << 27;  // more than any camera
constexpr std::uint64_t kMessagesPerProgress = 500;

/// Old recorders omit the first slash.
std::string full_name(const std::string& topic) {
  return topic.starts_with('/') ? topic : '/' + topic;
}

/// 16UC1 is a depth or a picture of more than 8 bits: the topic's name decides.
bool is_depth(const std::string& topic, std::string_view encoding) {
  constexpr std::array kNames{"depth", "disparity"};
  const bool is_named = std::ranges::any_of(
      kNames, [&](const char* name) { return topic.find(name) != std::string::npos; });
  return (encoding == "16UC1" && is_named) || encoding == "32FC1" ||
         encoding.find("compressedDepth") != std::string_view::npos;
}

struct SurveyedTopic {
  RosType type{RosType::kOther};
  std::size_t stream{0};  ///< Of images and IMUs.
  std::uint64_t count{0};
  Expected<CameraModel> lens = CameraModel{};  ///< Size 0: none came.
  Expected<CameraModel> rectified_lens = CameraModel{};
  bool used{false};       ///< A lens of an image topic.
  GrayDecoder decoder{};  ///< Of compressed images.
};

class LogSurveyor final {
 public:
  LogSurveyor(MessageLog& log, bool log_stamps) : log_(log), log_stamps_(log_stamps) {}

  Expected<LogSurvey> run(const ImportProgress& progress) {
    LoggedMessage message;
    for (std::uint64_t n = 0;; ++n) {
      const auto more = log_.next(message);
      if (!more) return tl::unexpected(more.error());
      if (!*more) break;
      add_new_topics();
      look_at(message);
      if (progress && n % kMessagesPerProgress == 0) progress(log_.share());
    }
    add_new_topics();
    match_lenses();
    for (std::size_t i = 0; i < topics_.size(); ++i)
      if (topics_[i].type == RosType::kOther ||
          (topics_[i].type == RosType::kCameraInfo && !topics_[i].used))
        survey_.others.push_back(printable_name(log_.topics()[i].name) + " (" +
                                 printable_name(log_.topics()[i].type) + ", " +
                                 std::to_string(topics_[i].count) + " messages)");
    survey_.remarks = log_.remarks();
    return std::move(survey_);
  }

 private:
  void add_new_topics() {
    while (topics_.size() < log_.topics().size()) {
      const LoggedTopic& topic = log_.topics()[topics_.size()];
      SurveyedTopic mine{ros_type(topic), survey_.streams.size()};
      if (mine.type != RosType::kOther && mine.type != RosType::kCameraInfo) {
        FoundStream stream;
        stream.kind = mine.type == RosType::kImu ? FoundKind::kImu : FoundKind::kImages;
        stream.name = printable_name(topic.name);
        stream.type = printable_name(topic.type);
        stream.has_gyro = stream.has_accel = stream.kind != FoundKind::kImu;
        survey_.streams.push_back(std::move(stream));
      }
      topics_.push_back(std::move(mine));
    }
  }

  void look_at(const LoggedMessage& message) {
    SurveyedTopic& topic = topics_[message.topic];
    ++topic.count;
    switch (topic.type) {
      case RosType::kImage:
      case RosType::kCompressedImage:
        return image(topic, message);
      case RosType::kImu:
        return imu(survey_.streams[topic.stream], message);
      case RosType::kCameraInfo:
        return lens(topic, message);
      case RosType::kOther:
        return;
    }
  }

  void image(SurveyedTopic& topic, const LoggedMessage& message) {
    FoundStream& stream = survey_.streams[topic.stream];
    const bool is_raw = topic.type == RosType::kImage;
    const auto read = is_raw ? ros::read_image(format(message), message.bytes)
                             : ros::read_compressed(format(message), message.bytes);
    if (!read) return unreadable(stream, read.error());
    const ros::RawImage& raw = read->image;
    if (is_raw)
      stream.used_bits = std::max(stream.used_bits, ros::used_bits(raw));
    else
      look_at_bits(topic, raw, stream);
    if (stream.count == 0) {
      stream.encoding = printable_name(raw.encoding);
      stream.is_depth = is_depth(stream.name, raw.encoding) ||
                        (!is_raw && is_depth(stream.name, raw.encoding.substr(0, 5)));
    }
    if (is_raw)
      set_size(stream, raw.width, raw.height);
    else if (stream.mount.model.width == 0)
      if (const auto size = encoded_size(std::as_bytes(raw.data)))
        set_size(stream, size->width, size->height);
    stamp(stream, read->stamp_ns, message.logged_ns);
  }

  /// Decodes the first image, and of 16 bits one of eight.
  void look_at_bits(SurveyedTopic& topic, const ros::RawImage& encoded, FoundStream& stream) {
    constexpr std::uint64_t kOneOf = 8;
    if (topic.count > 1 && (!topic.decoder.saw_16_bits() || topic.count % kOneOf != 0)) return;
    if (topic.decoder.decode(encoded.data, {}, scratch_))
      stream.used_bits = topic.decoder.used_bits();
  }

  void imu(FoundStream& stream, const LoggedMessage& message) {
    const auto read = ros::read_imu(format(message), message.bytes);
    if (!read) return unreadable(stream, read.error());
    stream.has_gyro = stream.has_gyro || !read->w.isZero(0);
    stream.has_accel = stream.has_accel || !read->f.isZero(0);
    stamp(stream, read->stamp_ns, message.logged_ns);
  }

  void lens(SurveyedTopic& topic, const LoggedMessage& message) {
    if (topic.lens && topic.lens->width != 0) return;  // a lens does not change
    topic.lens = ros::read_lens(format(message), message.bytes);
    topic.rectified_lens = ros::read_lens(format(message), message.bytes, true);
  }

  void stamp(FoundStream& stream, std::int64_t header_ns, std::int64_t logged_ns) {
    const std::int64_t ns = log_stamps_ ? logged_ns : header_ns;
    ++stream.count;
    if (ns <= 0) {
      ++stream.zero_stamps;
    } else if (stream.first_ns == 0) {
      stream.first_ns = stream.last_ns = ns;
    } else if (ns <= stream.last_ns) {
      ++stream.backwards;
    } else {
      stream.last_ns = ns;
    }
  }

  static void unreadable(FoundStream& stream, const Error& error) {
    if (stream.unreadable++ == 0) stream.first_fault = error.text();
  }

  static void set_size(FoundStream& stream, std::int64_t width, std::int64_t height) {
    CameraModel& model = stream.mount.model;
    if (model.width != 0 || width < 1 || height < 1 || width > kLargestSide ||
        height > kLargestSide || width * height > kMostPixels)
      return;
    model.width = static_cast<int>(width);
    model.height = static_cast<int>(height);
  }

  /// Assigns to each camera the lens of its camera_info.
  void match_lenses() {
    for (FoundStream& stream : survey_.streams) {
      if (stream.kind != FoundKind::kImages) continue;
      const std::string wanted = ros::camera_info_topic(full_name(stream.name));
      stream.lens_fault = "no message on " + wanted;
      for (std::size_t i = 0; i < topics_.size(); ++i) {
        if (topics_[i].type != RosType::kCameraInfo || full_name(log_.topics()[i].name) != wanted)
          continue;
        topics_[i].used = true;
        const CameraModel& size = stream.mount.model;
        const auto& lens =
            ros::is_rectified(full_name(stream.name)) ? topics_[i].rectified_lens : topics_[i].lens;
        if (!lens) {
          stream.lens_fault = wanted + ": " + lens.error().text();
        } else if (lens->width == 0) {
          continue;
        } else if (size.width != 0 && (lens->width != size.width || lens->height != size.height)) {
          stream.lens_fault = wanted + " is for images of another size";
        } else {
          stream.mount.model = *lens;
          stream.lens_known = true;
          stream.lens_fault.clear();
        }
      }
    }
  }

  [[nodiscard]] MessageFormat format(const LoggedMessage& message) const {
    return log_.topics()[message.topic].format;
  }

  MessageLog& log_;
  bool log_stamps_;
  std::vector<SurveyedTopic> topics_;
  GrayImage scratch_;
  LogSurvey survey_;
};

}  // namespace

RosType ros_type(const LoggedTopic& topic) {
  constexpr std::array<std::pair<std::string_view, RosType>, 4> kTypes{
      {{"sensor_msgs/Image", RosType::kImage},
       {"sensor_msgs/CompressedImage", RosType::kCompressedImage},
       {"sensor_msgs/Imu", RosType::kImu},
       {"sensor_msgs/CameraInfo", RosType::kCameraInfo}}};
  if (topic.format == MessageFormat::kOther) return RosType::kOther;
  for (const auto& [name, type] : kTypes)
    if (topic.type == name) return type;
  return RosType::kOther;
}

Expected<LogSurvey> survey_log(MessageLog& log, bool log_stamps, const ImportProgress& progress) {
  return LogSurveyor(log, log_stamps).run(progress);
}

}  // namespace fiducap
