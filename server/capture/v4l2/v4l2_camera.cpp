#include "capture/camera_device.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"
#include "capture/gray_image.hpp"
#include "capture/v4l2/controls.hpp"
#include "capture/v4l2/pixel_format.hpp"
#include "capture/v4l2/stream.hpp"

namespace fiducap::v4l2 {
namespace {

/// Counts lost images by cause and logs them: at once, then at most once a minute.
class LostImages final {
 public:
  enum Cause : std::size_t {
    kSkipped,     ///< Left out by the device or its driver: the sequence number is missing.
    kDamaged,     ///< Reported by the driver.
    kShort,       ///< Fewer bytes than pixels.
    kUnreadable,  ///< A JPEG that is damaged or incomplete.
    kOutOfOrder,  ///< Its stamp is not later than the one before.
    kCauses
  };

  explicit LostImages(std::string device) : device_(std::move(device)) {}

  void add(Cause cause, std::uint32_t images = 1) {
    counts_[cause] += images;
    since_last_ += images;
    is_unlogged_ = true;
  }
  /// An image arrived. @return number of images lost before it
  [[nodiscard]] std::uint32_t arrived(Instant now) {
    constexpr Duration kLogPeriod = std::chrono::minutes(1);
    if (is_unlogged_ && (!logged_at_ || now - *logged_at_ >= kLogPeriod)) {
      logged_at_ = now;
      is_unlogged_ = false;
      log::warning("capture", device_ + ": images lost since it was opened: " + text());
    }
    return std::exchange(since_last_, 0);
  }

 private:
  [[nodiscard]] std::string text() const {
    constexpr std::array<const char*, kCauses> kTexts{
        " not received (a full USB bus, a busy computer)",
        " damaged in transfer (cable, hub, power)", " incomplete (cable, hub, power)",
        " JPEGs that are damaged or end too early (cable, hub, power)",
        " stamped no later than the one before (clock of the driver)"};
    std::string all;
    for (std::size_t i = 0; i < kCauses; ++i)
      if (counts_[i] > 0) all += (all.empty() ? "" : ", ") + std::to_string(counts_[i]) + kTexts[i];
    return all;
  }

  std::string device_;
  std::array<std::uint64_t, kCauses> counts_{};
  std::uint32_t since_last_{0};
  bool is_unlogged_{false};
  std::optional<Instant> logged_at_;
};

enum class StampMark { kStartOfExposure, kFirstBytes, kEndOfFrame, kArrival };

std::string text_of(StampMark mark) {
  switch (mark) {
    case StampMark::kStartOfExposure:
      return "the kernel's, at the start of the exposure";
    case StampMark::kFirstBytes:
      return "the kernel's, when an image begins to arrive";
    case StampMark::kEndOfFrame:
      return "the kernel's, when an image has arrived";
    case StampMark::kArrival:
      break;
  }
  return "times of arrival, some milliseconds late: the driver uses another clock";
}

/// Computes the middle of the exposure from stamps.
class ExposureClock final {
 public:
  struct Delays {
    Duration exposure{0};
    Duration latency{0};     ///< End of exposure → stamp; not used if the stamp marks its start.
    Duration time_shift{0};  ///< Added in the end.
  };

  /// @param by_cameras_clock  parameter `hwtimestamps` of uvcvideo
  ExposureClock(Delays delays, const std::string& driver, bool by_cameras_clock)
      : delays_(delays), marks_first_bytes_(driver == "uvcvideo" && !by_cameras_clock) {}

  /// @param now  replaces an impossible stamp (from the future, or of another clock)
  [[nodiscard]] Instant middle(const KernelStamp& stamp, Instant now) {
    mark_ = mark_of(stamp, now);
    const Instant marked = mark_ == StampMark::kArrival ? now : instant_from_ns(stamp.ns);
    const Duration half = delays_.exposure / 2;
    const Instant middle =
        mark_ == StampMark::kStartOfExposure ? marked + half : marked - delays_.latency - half;
    return middle + delays_.time_shift;
  }
  void set_exposure(Duration exposure) { delays_.exposure = exposure; }

  /// Of the last stamp.
  [[nodiscard]] StampMark mark() const { return mark_; }

 private:
  [[nodiscard]] StampMark mark_of(const KernelStamp& stamp, Instant now) const {
    // Drivers that compute the end of a frame stamp less than a frame ahead; other clocks: days.
    constexpr Duration kLongestWait = std::chrono::seconds(5);  // of a buffer, for a busy reader
    constexpr Duration kFuture = std::chrono::milliseconds(200);
    const Duration age = now - instant_from_ns(stamp.ns);
    if (!stamp.is_monotonic || age < -kFuture || age > kLongestWait) return StampMark::kArrival;
    if (!stamp.marks_start) return StampMark::kEndOfFrame;
    return marks_first_bytes_ ? StampMark::kFirstBytes : StampMark::kStartOfExposure;
  }

  Delays delays_;
  bool marks_first_bytes_;  ///< uvcvideo reports them as start of exposure.
  StampMark mark_{StampMark::kArrival};
};

constexpr Duration kSlice = std::chrono::milliseconds(100);  // delay of a stop
constexpr Duration kExposureReadEvery = std::chrono::seconds(1);

/// An open camera. The port outlives the stream.
struct Parts {
  std::string device;
  std::unique_ptr<Port> port;
  Identity identity;
  ChosenMode mode;
  ExposureClock exposure_clock;
  bool exposure_changes{};     ///< By the device: it is read again periodically.
  Duration longest_silence{};  ///< 0: no limit.
};

double rate_of(const ChosenMode& mode) {
  return mode.measured_hz > 0 ? mode.measured_hz : mode.mode.rate_hz;
}

Duration longest_exposure(const ChosenMode& mode) {
  constexpr Duration kMaxExposure = std::chrono::seconds(1);
  const double rate_hz = rate_of(mode);
  return rate_hz > 0 ? std::min(from_seconds(1 / rate_hz), kMaxExposure) : kMaxExposure;
}

tl::unexpected<Error> with_device(Error error, const std::string& device) {
  error.context = device;
  return tl::unexpected(std::move(error));
}

class V4l2Camera final : public SensorSource {
 public:
  V4l2Camera(Parts parts, const Clock& clock)
      : parts_(std::move(parts)), clock_(clock), lost_(parts_.device), last_came_(clock.now()) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      auto taken = parts_.mode.stream->take(kSlice);
      if (!taken) return with_device(taken.error(), parts_.device);
      const Instant now = clock_.now();
      if (!*taken) {
        const Duration limit = parts_.longest_silence;
        if (limit == Duration{0} || now - last_came_ <= limit) continue;
        return fail(ErrorCode::kClosed,
                    "gave no image for " + fixed(to_seconds(limit), 1) +
                        " s; is it still plugged in, and its USB bus not full?",
                    parts_.device);
      }
      last_came_ = now;
      auto frame = frame_of(**taken, now);
      parts_.mode.stream->give_back(**taken);
      if (frame) return std::move(*frame);
    }
    return std::nullopt;
  }

 private:
  /// nullopt: not usable.
  std::optional<CameraFrame> frame_of(const FilledBuffer& buffer, Instant now) {
    // Numbers wrap; a large jump is a restart.
    constexpr std::uint32_t kMostSkipped = 10'000;
    const std::uint32_t skipped = last_sequence_ ? buffer.sequence - *last_sequence_ - 1 : 0;
    if (skipped > 0 && skipped <= kMostSkipped) lost_.add(LostImages::kSkipped, skipped);
    last_sequence_ = buffer.sequence;
    auto image = image_of(buffer);
    if (!image) return std::nullopt;
    follow_exposure(now);
    const Instant exposed_at = parts_.exposure_clock.middle(buffer.stamp, now);
    const StampMark mark = parts_.exposure_clock.mark();
    if (std::exchange(logged_mark_, mark) != mark)
      log::info("capture", parts_.device + ": stamps are " + text_of(mark));
    if (last_exposed_ && exposed_at <= *last_exposed_) {
      lost_.add(LostImages::kOutOfOrder);
      return std::nullopt;
    }
    last_exposed_ = exposed_at;
    CameraFrame frame{0, exposed_at, std::move(image)};
    frame.lost_before = lost_.arrived(now);
    return frame;
  }

  std::shared_ptr<const GrayImage> image_of(const FilledBuffer& buffer) {
    if (buffer.damaged) {
      lost_.add(LostImages::kDamaged);
      return nullptr;
    }
    const Mode& mode = parts_.mode.mode;
    std::shared_ptr<GrayImage> image = pool_.acquire();
    image->resize(mode.size.width, mode.size.height);
    if (parts_.mode.format->layout == Layout::kJpeg) {
      if (jpeg_.read(buffer.bytes, *image)) return image;
      lost_.add(LostImages::kUnreadable);
      return nullptr;
    }
    if (read_gray(*parts_.mode.format, buffer.bytes, mode.stride, *image)) return image;
    lost_.add(LostImages::kShort);
    return nullptr;
  }

  void follow_exposure(Instant now) {
    if (!parts_.exposure_changes || now - exposure_read_at_ < kExposureReadEvery) return;
    exposure_read_at_ = now;
    if (const auto time = read_exposure(*parts_.port).time)
      parts_.exposure_clock.set_exposure(std::min(*time, longest_exposure(parts_.mode)));
  }

  Parts parts_;
  const Clock& clock_;
  GrayImagePool pool_;
  JpegGray jpeg_;
  LostImages lost_;
  Instant last_came_;
  Instant exposure_read_at_{};
  std::optional<Instant> last_exposed_;
  std::optional<std::uint32_t> last_sequence_;
  std::optional<StampMark> logged_mark_;
};

/// Parameter of the driver of USB cameras; off when not readable.
bool uvc_counts_by_cameras_clock() {
  std::ifstream file("/sys/module/uvcvideo/parameters/hwtimestamps");
  char first = 'N';
  file >> first;
  return first == 'Y' || first == '1';
}

ModeRequest request_of(const CameraDeviceConfig& config, const CameraModel& camera) {
  ModeRequest request;
  request.format = pixel_format(std::string_view(config.format));
  request.size = config.width > 0 ? PixelSize{config.width, config.height}
                                  : PixelSize{camera.width, camera.height};
  request.rate_hz = config.rate_hz;
  const auto trigger = parse_control_setting(config.trigger).value_or(ControlSetting{});
  request.waits_for_trigger =
      trigger.kind == ControlSetting::Kind::kOn ||
      (trigger.kind == ControlSetting::Kind::kNumber && trigger.number != 0);
  return request;
}

void log_mode(const std::string& device, const Identity& identity, const ChosenMode& mode,
              double requested_hz) {
  log::info("capture", device + " (" + identity.card + "): " + std::string(mode.format->name) +
                           " " + size_text(mode.mode.size) + " at " + fixed(rate_of(mode), 1) +
                           " Hz " + (mode.measured_hz > 0 ? "measured" : "nominal") +
                           (mode.others.empty() ? "" : "; also offers " + mode.others));
  constexpr double kMuchLess = 0.8;
  const double nominal_hz = std::max(requested_hz, mode.mode.rate_hz);
  if (mode.measured_hz > 0 && mode.measured_hz < kMuchLess * nominal_hz)
    log::warning("capture", device + ": gives " + fixed(mode.measured_hz, 1) + " Hz instead of " +
                                fixed(nominal_hz, 1) +
                                ": an automatic exposure lowers the rate in the dark (exposure: "
                                "manual), or the USB bus is full (format, size)");
}

void log_settings(const std::string& device, const SettingsReport& report) {
  if (!report.done.empty())
    log::info("capture", device + ": set and read back: " + comma_list(report.done));
  for (const std::string& one : report.undone) log::warning("capture", device + ": " + one);
}

/// Exposure as reported by the device, or as configured; logs when it is unknown.
Duration known_exposure(const std::string& device, const DeviceExposure& reported,
                        const CameraDeviceConfig& config, Duration longest) {
  if (reported.time) {
    log::info("capture", device + ": exposes " + fixed(to_seconds(*reported.time) * 1e3, 1) +
                             " ms" + (reported.is_automatic ? ", automatic" : "") +
                             ", as reported by the device");
    return std::min(*reported.time, longest);
  }
  if (config.exposure_s > 0) return from_seconds(config.exposure_s);
  const std::string why = reported.is_in_lines ? "reports its exposure in lines of its sensor"
                                               : "does not report its exposure";
  log::warning("capture", device + ": " + why + ": stamps are off by half of it, up to " +
                              fixed(to_seconds(longest) * 500, 0) +
                              " ms; configure exposure_s if you know it");
  return Duration{0};
}

}  // namespace

OpenedSource open_v4l2_camera(std::unique_ptr<Port> port, const std::string& device,
                              const CameraDeviceConfig& config, const CameraModel& camera,
                              const Clock& clock) {
  auto identity = identify(*port, device);
  if (!identity) return with_device(identity.error(), device);
  (void)apply_settings(*port, config);  // the measured rate depends on them
  const ModeRequest request = request_of(config, camera);
  auto mode = choose_mode(*port, *identity, request, clock);
  if (!mode) return with_device(mode.error(), device);
  if (const auto fits = fits_calibration(mode->mode.size, camera, device); !fits)
    return tl::unexpected(fits.error());
  log_mode(device, *identity, *mode, config.rate_hz);
  log_settings(device, apply_settings(*port, config));

  const Duration longest = longest_exposure(*mode);
  const DeviceExposure reported = read_exposure(*port);
  const ExposureClock::Delays delays{known_exposure(device, reported, config, longest),
                                     from_seconds(config.latency_s), config.time_shift};
  ExposureClock exposure_clock(delays, identity->driver, uvc_counts_by_cameras_clock());
  constexpr int kMissedPeriods = 20;
  constexpr Duration kShortestSilence = std::chrono::seconds(1);
  const Duration silence = request.waits_for_trigger
                               ? Duration{0}
                               : std::max(kMissedPeriods * longest, kShortestSilence);
  return std::make_unique<V4l2Camera>(
      Parts{device, std::move(port), std::move(*identity), std::move(*mode),
            std::move(exposure_clock), reported.time.has_value() && reported.is_automatic, silence},
      clock);
}

}  // namespace fiducap::v4l2
