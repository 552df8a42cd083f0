#include "capture/v4l2/v4l2_camera.hpp"

#include <algorithm>
#include <fstream>
#include <optional>
#include <utility>

#include "base/log.hpp"
#include "base/text.hpp"
#include "capture/control_wish.hpp"
#include "capture/gray_image.hpp"
#include "capture/v4l2/exposure_clock.hpp"
#include "capture/v4l2/jpeg_gray.hpp"
#include "capture/v4l2/lost_images.hpp"
#include "capture/v4l2/mode_choice.hpp"
#include "capture/v4l2/settings.hpp"

namespace fiducap::v4l2 {
namespace {

constexpr Duration kSlice = std::chrono::milliseconds(100);  // a stop is seen so soon
constexpr Duration kExposureReadEvery = std::chrono::seconds(1);

/// What a camera that is open consists of. The port outlives the stream.
struct Parts {
  std::string device;
  std::unique_ptr<Port> port;
  Identity identity;
  ChosenMode mode;
  ExposureClock exposure_clock;
  bool exposure_changes{};     ///< The device rules it: it is read again now and then.
  Duration longest_silence{};  ///< 0: it may be silent for ever.
};

class V4l2Camera final : public SensorSource {
 public:
  V4l2Camera(Parts parts, const Clock& clock)
      : parts_(std::move(parts)), clock_(clock), lost_(parts_.device), last_came_(clock.now()) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      auto taken = parts_.mode.stream->take(kSlice);
      if (!taken) return tl::unexpected(here(taken.error()));
      const Instant now = clock_.now();
      if (!*taken) {
        if (is_silent(now)) return tl::unexpected(silence());
        continue;
      }
      last_came_ = now;
      auto frame = frame_of(**taken, now);
      parts_.mode.stream->give_back(**taken);
      if (frame) return std::move(*frame);
    }
    return std::nullopt;
  }

 private:
  /// nullopt: nothing that may be used.
  std::optional<CameraFrame> frame_of(const FilledBuffer& buffer, Instant now) {
    count_skipped(buffer.sequence);
    auto image = image_of(buffer);
    if (!image) return std::nullopt;
    follow_exposure(now);
    const Instant exposed_at = parts_.exposure_clock.middle(buffer.stamp, now);
    say_other_mark();
    if (last_exposed_ && exposed_at <= *last_exposed_) {
      lost_.add(LostImages::Cause::kOutOfOrder);
      return std::nullopt;
    }
    last_exposed_ = exposed_at;
    CameraFrame frame{0, exposed_at, std::move(image)};
    frame.lost_before = lost_.came(now);
    return frame;
  }

  /// Numbers wrap; one that is far off is a new beginning.
  void count_skipped(std::uint32_t sequence) {
    constexpr std::uint32_t kMostSkipped = 10'000;
    const std::uint32_t skipped = last_sequence_ ? sequence - *last_sequence_ - 1 : 0;
    if (skipped > 0 && skipped <= kMostSkipped) lost_.add(LostImages::Cause::kSkipped, skipped);
    last_sequence_ = sequence;
  }

  std::shared_ptr<const GrayImage> image_of(const FilledBuffer& buffer) {
    if (buffer.damaged) {
      lost_.add(LostImages::Cause::kDamaged);
      return nullptr;
    }
    const Mode& mode = parts_.mode.mode;
    std::shared_ptr<GrayImage> image = pool_.acquire();
    image->resize(mode.size.width, mode.size.height);
    if (parts_.mode.format->layout == Layout::kJpeg) {
      if (jpeg_.read(buffer.bytes, *image)) return image;
      lost_.add(LostImages::Cause::kUnreadable);
      return nullptr;
    }
    if (read_gray(*parts_.mode.format, buffer.bytes, mode.stride, *image)) return image;
    lost_.add(LostImages::Cause::kShort);
    return nullptr;
  }

  void follow_exposure(Instant now) {
    if (!parts_.exposure_changes || now - exposure_read_at_ < kExposureReadEvery) return;
    exposure_read_at_ = now;
    if (const auto time = read_exposure(*parts_.port).time)
      parts_.exposure_clock.set_exposure(std::min(*time, longest_exposure(parts_.mode)));
  }

  void say_other_mark() {
    const StampMark mark = parts_.exposure_clock.mark();
    if (std::exchange(said_mark_, mark) == mark) return;
    log::info("capture", parts_.device + ": stamps are " + words_for(mark));
  }

  [[nodiscard]] bool is_silent(Instant now) const {
    return parts_.longest_silence > Duration{0} && now - last_came_ > parts_.longest_silence;
  }
  [[nodiscard]] Error silence() const {
    return here({ErrorCode::kClosed,
                 "gave no image for " + fixed(to_seconds(parts_.longest_silence), 1) +
                     " s; is it still plugged in, and its USB bus not full?",
                 {}});
  }
  [[nodiscard]] Error here(Error error) const {
    error.context = parts_.device;
    return error;
  }

 public:
  static Duration longest_exposure(const ChosenMode& mode) {
    constexpr Duration kAnybodys = std::chrono::seconds(1);
    const double rate_hz = mode.measured_hz > 0 ? mode.measured_hz : mode.mode.rate_hz;
    return rate_hz > 0 ? std::min(from_seconds(1 / rate_hz), kAnybodys) : kAnybodys;
  }

 private:
  Parts parts_;
  const Clock& clock_;
  GrayImagePool pool_;
  JpegGray jpeg_;
  LostImages lost_;
  Instant last_came_;
  Instant exposure_read_at_{};
  std::optional<Instant> last_exposed_;
  std::optional<std::uint32_t> last_sequence_;
  std::optional<StampMark> said_mark_;
};

/// The parameter of the driver for USB cameras; off where it cannot be read.
bool uvc_counts_by_cameras_clock() {
  std::ifstream file("/sys/module/uvcvideo/parameters/hwtimestamps");
  char first = 'N';
  file >> first;
  return first == 'Y' || first == '1';
}

ModeWish wish_of(const CameraDeviceConfig& config, const CameraModel& camera) {
  ModeWish wish;
  wish.format = pixel_format(std::string_view(config.format));
  wish.size = config.width > 0 ? PixelSize{config.width, config.height}
                               : PixelSize{camera.width, camera.height};
  wish.rate_hz = config.rate_hz;
  const auto trigger = control_wish(config.trigger).value_or(ControlWish{});
  wish.waits_for_trigger = trigger.kind == ControlWish::Kind::kOn ||
                           (trigger.kind == ControlWish::Kind::kNumber && trigger.number != 0);
  return wish;
}

Expected<void> fits_calibration(const Mode& mode, const CameraModel& camera) {
  const PixelSize calibrated{camera.width, camera.height};
  if (camera.width == 0 || mode.size == calibrated) return {};
  return fail(ErrorCode::kInvalid,
              "gives images of " + size_text(mode.size) + ", the calibration is for " +
                  size_text(calibrated) +
                  ": use the calibration of this mode, or ask the device for the calibrated size");
}

void say_mode(const std::string& device, const Identity& identity, const ChosenMode& mode,
              double asked_hz) {
  const double rate_hz = mode.measured_hz > 0 ? mode.measured_hz : mode.mode.rate_hz;
  log::info("capture", device + " (" + identity.card + "): " + std::string(mode.format->name) +
                           " " + size_text(mode.mode.size) + " at " + fixed(rate_hz, 1) + " Hz " +
                           (mode.measured_hz > 0 ? "measured" : "promised") +
                           (mode.others.empty() ? "" : "; also offers " + mode.others));
  constexpr double kMuchLess = 0.8;
  const double promised_hz = std::max(asked_hz, mode.mode.rate_hz);
  if (mode.measured_hz > 0 && mode.measured_hz < kMuchLess * promised_hz) {
    log::warning("capture", device + ": gives " + fixed(mode.measured_hz, 1) + " Hz instead of " +
                                fixed(promised_hz, 1) +
                                ": an automatic exposure lowers the rate in the dark (exposure: "
                                "manual), or the USB bus is full (format, size)");
  }
}

void say_settings(const std::string& device, const SettingsReport& report) {
  std::string done;
  for (const std::string& one : report.done) done += (done.empty() ? "" : ", ") + one;
  if (!done.empty()) log::info("capture", device + ": set and read back: " + done);
  for (const std::string& one : report.undone) log::warning("capture", device + ": " + one);
}

/// How long it exposes, as far as that can be known; what is not known is said.
Duration known_exposure(const std::string& device, const DeviceExposure& said,
                        const CameraDeviceConfig& config, Duration longest) {
  if (said.time) {
    log::info("capture", device + ": exposes " + fixed(to_seconds(*said.time) * 1e3, 1) + " ms" +
                             (said.is_automatic ? ", and may change that" : "") +
                             ", as the device says");
    return std::min(*said.time, longest);
  }
  if (config.exposure_s > 0) return from_seconds(config.exposure_s);
  const std::string why = said.is_in_lines ? "says its exposure in lines of its sensor, not in time"
                                           : "does not say how long it exposes";
  log::warning("capture", device + ": " + why + ": stamps are off by half of that, up to " +
                              fixed(to_seconds(longest) * 500, 0) +
                              " ms; write exposure_s if you know it");
  return Duration{0};
}

}  // namespace

Expected<std::unique_ptr<SensorSource>> open_v4l2_camera(std::unique_ptr<Port> port,
                                                         const std::string& device,
                                                         const CameraDeviceConfig& config,
                                                         const CameraModel& camera,
                                                         const Clock& clock) {
  const auto with_name = [&device](Error error) {
    error.context = device;
    return tl::unexpected(std::move(error));
  };
  auto identity = identify(*port, device);
  if (!identity) return with_name(identity.error());
  (void)apply_settings(*port, config);  // before the rate is measured, which depends on them
  const ModeWish wish = wish_of(config, camera);
  auto mode = choose_mode(*port, *identity, wish, clock);
  if (!mode) return with_name(mode.error());
  if (const auto fits = fits_calibration(mode->mode, camera); !fits) return with_name(fits.error());
  say_mode(device, *identity, *mode, config.rate_hz);
  say_settings(device, apply_settings(*port, config));

  const Duration longest = V4l2Camera::longest_exposure(*mode);
  const DeviceExposure said = read_exposure(*port);
  const ExposureClock::Delays delays{known_exposure(device, said, config, longest),
                                     from_seconds(config.latency_s), config.time_shift};
  ExposureClock exposure_clock(delays, identity->driver, uvc_counts_by_cameras_clock());
  constexpr int kMissedPeriods = 20;
  constexpr Duration kShortestSilence = std::chrono::seconds(1);
  const Duration silence =
      wish.waits_for_trigger ? Duration{0} : std::max(kMissedPeriods * longest, kShortestSilence);
  return std::make_unique<V4l2Camera>(
      Parts{device, std::move(port), std::move(*identity), std::move(*mode),
            std::move(exposure_clock), said.time.has_value() && said.is_automatic, silence},
      clock);
}

}  // namespace fiducap::v4l2
