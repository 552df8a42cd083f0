// IMUs by libiio, whose header is included here only.
#include <iio.h>

#include <cerrno>
#include <cmath>
#include <cstring>

#include "base/log.hpp"
#include "base/text.hpp"
#include "capture/imu/imu_source.hpp"
#include "capture/reading_pairs.hpp"
#include "capture/stamp_mapper.hpp"

namespace fiducap {
namespace {

// Local: delay of a stop. Over a network a time-out ends the session.
constexpr unsigned kLocalTimeout_ms = 300;
constexpr unsigned kNetworkTimeout_ms = 2000;
constexpr double kRateTolerance = 0.05;
constexpr std::size_t kLongestText = 256;

std::string reason_of(int error) {
  std::array<char, 128> text{};
  iio_strerror(std::abs(error), text.data(), text.size());
  return text.data();
}

std::string name_of_device(const iio_device* device) {
  const char* name = iio_device_get_name(device);
  const char* id = iio_device_get_id(device);
  return name != nullptr ? name : id != nullptr ? id : "?";
}

bool is_called(const iio_device* device, const std::string& name) {
  const auto is_name = [&name](const char* own) { return own != nullptr && name == own; };
  return is_name(iio_device_get_name(device)) || is_name(iio_device_get_label(device)) ||
         is_name(iio_device_get_id(device));
}

/// @param read  iio_device_attr_read or iio_channel_attr_read
template <typename From, typename Read>
std::optional<std::string> read_text(Read read, const From* from, const char* attribute) {
  std::array<char, kLongestText> text{};
  if (read(from, attribute, text.data(), text.size()) <= 0) return std::nullopt;
  return std::string(text.data());
}

std::optional<double> read_number(const iio_channel* channel, const char* attribute) {
  double value = 0;
  if (iio_channel_attr_read_double(channel, attribute, &value) != 0 || !std::isfinite(value))
    return std::nullopt;
  return value;
}

/// Of the sensor, or of the whole device; drivers differ.
Eigen::Matrix3d mount_of(const iio_device* device, const iio_channel* channel,
                         const std::string& kind) {
  for (const auto& text :
       {read_text(iio_channel_attr_read, channel, "mount_matrix"),
        read_text(iio_device_attr_read, device, ("in_" + kind + "_mount_matrix").c_str()),
        read_text(iio_device_attr_read, device, "in_mount_matrix"),
        read_text(iio_device_attr_read, device, "mount_matrix")}) {
    if (!text) continue;
    if (const auto matrix = parse_mount_matrix(*text)) return *matrix;
    log::warning("capture", name_of_device(device) + ": its mount_matrix (" + *text +
                                ") is no rotation and is not used");
  }
  return Eigen::Matrix3d::Identity();
}

/// A whole number of the channel's format, in this machine's byte order.
double whole_number(const iio_channel* channel, const void* converted) {
  const iio_data_format& format = *iio_channel_get_data_format(channel);
  switch (format.length) {
    case 8:
      return *static_cast<const std::int8_t*>(converted);
    case 16:
      return *static_cast<const std::int16_t*>(converted);
    case 32:
      return *static_cast<const std::int32_t*>(converted);
    default:
      return static_cast<double>(*static_cast<const std::int64_t*>(converted));
  }
}

struct CloseIio {
  void operator()(iio_context* context) const { iio_context_destroy(context); }
  void operator()(iio_buffer* buffer) const { iio_buffer_destroy(buffer); }
};

/// A session with this machine's kernel or with iiod of another machine.
using Context = std::unique_ptr<iio_context, CloseIio>;

Expected<Context> open_context(const std::string& uri) {
  iio_context* context = iio_create_context_from_uri(uri.c_str());
  if (context != nullptr) return Context(context);
  const int reason = errno;
  return fail(ErrorCode::kUnavailable,
              uri == "local:" ? "this machine has no IIO device (" + reason_of(reason) +
                                    "): is its driver loaded? /sys/bus/iio/devices lists them"
                              : "no iiod answers there (" + reason_of(reason) +
                                    "): is it running, and reachable?",
              uri);
}

/// A device by its name, label or id; empty: the first one with such a channel.
/// @param channel  e.g. `anglvel_x`   @return Error with the devices present
Expected<iio_device*> find_device(const iio_context* context, const std::string& name,
                                  const char* channel) {
  std::string all;
  for (unsigned i = 0; i < iio_context_get_devices_count(context); ++i) {
    iio_device* device = iio_context_get_device(context, i);
    const bool has_channel = iio_device_find_channel(device, channel, false) != nullptr;
    if (has_channel && (name.empty() || is_called(device, name))) return device;
    all += (all.empty() ? "" : ", ") + name_of_device(device) + (has_channel ? "" : " (has none)");
  }
  return fail(ErrorCode::kNotFound, "there is no IIO device " + name + (name.empty() ? "" : " ") +
                                        "with a channel " + channel +
                                        "; there are: " + (all.empty() ? "none" : all));
}

/// One device with buffered readings and the kernel's stamps.
class Device final {
 public:
  /// One reading in SI units, after the mount matrix.
  using Reading = ReadingPairs::Pair;

  /// Sets rate, clock and trigger, and starts the buffer.
  /// @return Error with device and cause
  [[nodiscard]] static Expected<Device> open(iio_context* context, iio_device* device,
                                             bool has_gyro, bool has_accel,
                                             const IioConfig& config) {
    Device made(device, name_of_device(device));
    made.is_local_ = std::string_view(iio_context_get_name(context)) == "local";
    // Other users may have left channels enabled.
    for (unsigned i = 0; i < iio_device_get_channels_count(device); ++i)
      iio_channel_disable(iio_device_get_channel(device, i));
    auto gyro = made.find_triad(has_gyro, "anglvel");
    auto accel = made.find_triad(has_accel, "accel");
    for (const auto* triad : {&gyro, &accel}) {
      if (!*triad) return tl::unexpected(triad->error());
      if (auto enabled = made.enable(**triad); !enabled) return tl::unexpected(enabled.error());
    }
    made.gyro_ = *gyro;
    made.accel_ = *accel;
    made.stamp_ = iio_device_find_channel(device, "timestamp", false);
    if (made.stamp_ == nullptr)
      return fail(ErrorCode::kUnsupported, "has no timestamp channel: its readings have no stamps",
                  made.name_);
    iio_channel_enable(made.stamp_);
    if (auto set = made.set_trigger(context, config.trigger); !set)
      return tl::unexpected(set.error());
    made.set_rate(config.rate_hz);
    made.set_clock();
    iio_context_set_timeout(context, made.is_local_ ? kLocalTimeout_ms : kNetworkTimeout_ms);
    made.buffer_.reset(
        iio_device_create_buffer(device, static_cast<std::size_t>(config.samples), false));
    if (made.buffer_) return made;
    const int reason = errno;
    return fail(
        ErrorCode::kUnavailable,
        "its buffer does not start (" + reason_of(reason) +
            "): is it used by another program, may this user open /dev/iio:device*, and does "
            "it need a trigger (`trigger`, e.g. of iio-trig-hrtimer)?",
        made.name_);
  }

  /// Waits for the next buffer. @return true: readings came; false: none in time; Error: lost
  [[nodiscard]] Expected<bool> refill() {
    const ssize_t size = iio_buffer_refill(buffer_.get());
    const bool is_late = size == -ETIMEDOUT || size == -EAGAIN || size == -EINTR;
    if (size < 0 && is_late && is_local_) return false;
    if (size < 0)
      return fail(
          ErrorCode::kClosed,
          "gives no more readings (" + reason_of(static_cast<int>(size)) + "): is it still there?",
          name_);
    const auto step = iio_buffer_step(buffer_.get());
    const auto* begin = static_cast<const char*>(iio_buffer_start(buffer_.get()));
    const auto* end = static_cast<const char*>(iio_buffer_end(buffer_.get()));
    const auto count = step > 0 ? static_cast<std::size_t>((end - begin) / step) : 0;
    readings_.resize(count);
    for (std::size_t k = 0; k < count; ++k) {
      Reading& reading = readings_[k];
      const auto* stamps = static_cast<const char*>(iio_buffer_first(buffer_.get(), stamp_));
      iio_channel_convert(stamp_, &reading.stamp_ns,
                          stamps + static_cast<std::ptrdiff_t>(k) * step);
      if (gyro_) reading.w = read(*gyro_, k);
      if (accel_) reading.f = read(*accel_, k);
    }
    return count > 0;
  }
  [[nodiscard]] const std::vector<Reading>& readings() const { return readings_; }

  [[nodiscard]] const std::string& name() const { return name_; }
  /// Stamps are on this machine's monotonic clock.
  [[nodiscard]] bool is_on_our_clock() const { return is_on_our_clock_; }
  [[nodiscard]] std::optional<double> rate_hz() const { return rate_hz_; }

 private:
  struct Triad {
    std::array<iio_channel*, 3> channels{};
    Eigen::Vector3d scale{Eigen::Vector3d::Ones()};
    Eigen::Vector3d offset{Eigen::Vector3d::Zero()};
    Eigen::Matrix3d mount{Eigen::Matrix3d::Identity()};
  };
  Device(iio_device* device, std::string name) : device_(device), name_(std::move(name)) {}

  Expected<std::optional<Triad>> find_triad(bool wanted, const char* kind) const {
    if (!wanted) return std::optional<Triad>();
    Triad triad;
    for (int i = 0; i < 3; ++i) {
      const std::string id = std::string(kind) + "_" + "xyz"[i];
      iio_channel* channel = iio_device_find_channel(device_, id.c_str(), false);
      if (channel == nullptr) return fail(ErrorCode::kNotFound, "has no channel " + id, name_);
      triad.channels[static_cast<std::size_t>(i)] = channel;
      triad.scale[i] = read_number(channel, "scale").value_or(1.0);
      triad.offset[i] = read_number(channel, "offset").value_or(0.0);
    }
    triad.mount = mount_of(device_, triad.channels[0], kind);
    return std::optional(triad);
  }

  Expected<void> enable(const std::optional<Triad>& triad) const {
    if (!triad) return {};
    for (iio_channel* channel : triad->channels) {
      if (!iio_channel_is_scan_element(channel))
        return fail(ErrorCode::kUnsupported,
                    "its driver has no buffers, so its readings have no stamps", name_);
      iio_channel_enable(channel);
    }
    return {};
  }

  Expected<void> set_trigger(iio_context* context, const std::string& name) const {
    if (name.empty()) return {};
    const iio_device* trigger = iio_context_find_device(context, name.c_str());
    if (trigger == nullptr || !iio_device_is_trigger(trigger))
      return fail(ErrorCode::kNotFound, "there is no trigger " + name, name_);
    const int result = iio_device_set_trigger(device_, trigger);
    if (result == 0) return {};
    return fail(ErrorCode::kUnavailable,
                "refuses the trigger " + name + " (" + reason_of(result) + ")", name_);
  }

  /// Of the sensor, or of the whole device. Logs a different actual rate.
  void set_rate(double rate_hz) {
    constexpr const char* kRate = "sampling_frequency";
    for (const auto& triad : {gyro_, accel_}) {
      if (!triad) continue;
      iio_channel* channel = triad->channels[0];
      const bool is_own = iio_channel_find_attr(channel, kRate) != nullptr;
      if (rate_hz > 0 && is_own) iio_channel_attr_write_double(channel, kRate, rate_hz);
      if (rate_hz > 0 && !is_own) iio_device_attr_write_double(device_, kRate, rate_hz);
      double given = 0;
      const bool is_known = is_own ? iio_channel_attr_read_double(channel, kRate, &given) == 0
                                   : iio_device_attr_read_double(device_, kRate, &given) == 0;
      if (is_known) rate_hz_ = given;
      const bool is_met = is_known && std::abs(given - rate_hz) <= kRateTolerance * rate_hz;
      if (rate_hz <= 0 || is_met) continue;
      const auto offered =
          is_own ? read_text(iio_channel_attr_read, channel, "sampling_frequency_available")
                 : read_text(iio_device_attr_read, device_, "sampling_frequency_available");
      log::warning("capture",
                   name_ + ": " +
                       (is_known ? "samples at " + fixed(given, 1) + " Hz instead of "
                                 : std::string("does not report its rate, requested are ")) +
                       fixed(rate_hz, 1) + " Hz" +
                       (offered ? "; it offers " + *offered : std::string()));
    }
  }

  /// The kernel's default is the wall clock, which NTP adjusts.
  void set_clock() {
    constexpr const char* kClock = "current_timestamp_clock";
    iio_device_attr_write(device_, kClock, "monotonic");
    const auto clock = read_text(iio_device_attr_read, device_, kClock);
    const bool is_monotonic =
        clock && clock->starts_with("monotonic") && !clock->starts_with("monotonic_");
    is_on_our_clock_ = is_local_ && is_monotonic;
    if (is_local_ && !is_monotonic)
      log::warning("capture", name_ + ": its stamps are of the clock " + clock.value_or("?") +
                                  " and cannot be set to monotonic: they are placed by arrival");
  }

  Eigen::Vector3d read(const Triad& triad, std::size_t k) const {
    const auto step = iio_buffer_step(buffer_.get());
    Eigen::Vector3d value;
    for (int i = 0; i < 3; ++i) {
      const iio_channel* channel = triad.channels[static_cast<std::size_t>(i)];
      const auto* first = static_cast<const char*>(iio_buffer_first(buffer_.get(), channel));
      std::int64_t converted = 0;
      iio_channel_convert(channel, &converted, first + static_cast<std::ptrdiff_t>(k) * step);
      value[i] = (whole_number(channel, &converted) + triad.offset[i]) * triad.scale[i];
    }
    return triad.mount * value;
  }

  iio_device* device_;
  std::string name_;
  std::optional<Triad> gyro_;
  std::optional<Triad> accel_;
  iio_channel* stamp_{nullptr};
  bool is_on_our_clock_{false};
  bool is_local_{false};
  std::optional<double> rate_hz_;
  std::unique_ptr<iio_buffer, CloseIio> buffer_;
  std::vector<Reading> readings_;
};

class IioSource final : public SensorSource {
 public:
  /// @param accel  nullopt: part of the gyroscope's device
  IioSource(Context context, Device gyro, std::optional<Device> accel, const Clock& clock)
      : context_(std::move(context)),
        gyro_(std::move(gyro)),
        accel_(std::move(accel)),
        clock_(clock) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (auto sample = waiting_.take()) return *sample;
      const bool reads_gyro = !accel_ || pairs_.gyro_is_behind();
      Device& device = reads_gyro ? gyro_ : *accel_;
      const auto came = device.refill();
      if (!came) return tl::unexpected(came.error());
      if (*came) take(device, reads_gyro);
    }
    return std::nullopt;
  }

 private:
  void take(const Device& device, bool is_gyro) {
    const Instant now = clock_.now();
    for (const auto& reading : device.readings()) {
      if (!accel_) {
        place(reading, now);
      } else if (is_gyro) {
        pairs_.add_gyro({reading.stamp_ns, reading.w});
      } else {
        pairs_.add_accel({reading.stamp_ns, reading.f});
      }
    }
    while (const auto pair = pairs_.take()) place(*pair, now);
  }

  void place(const ReadingPairs::Pair& pair, Instant now) {
    const auto known = gyro_.is_on_our_clock() ? std::optional(Duration{0}) : std::nullopt;
    const auto at = device_clock_.place(static_cast<std::uint64_t>(pair.stamp_ns), now, known);
    if (at) waiting_.push({*at, pair.w, pair.f});
  }

  Context context_;  // destroyed last
  Device gyro_;
  std::optional<Device> accel_;
  const Clock& clock_;
  ReadingPairs pairs_;
  DeviceClock device_clock_{64, 1};
  ImuQueue waiting_;
};

}  // namespace

OpenedSource open_iio_source(const IioConfig& config, const Clock& clock) {
  auto context = open_context(config.uri);
  if (!context) return tl::unexpected(context.error());
  const auto gyro_device = find_device(context->get(), config.gyro, "anglvel_x");
  if (!gyro_device) return tl::unexpected(gyro_device.error());
  const auto accel_device = find_device(context->get(), config.accel, "accel_x");
  if (!accel_device) return tl::unexpected(accel_device.error());
  const bool is_one = *gyro_device == *accel_device;
  auto gyro = Device::open(context->get(), *gyro_device, true, is_one, config);
  if (!gyro) return tl::unexpected(gyro.error());
  std::optional<Device> accel;
  if (!is_one) {
    auto opened = Device::open(context->get(), *accel_device, false, true, config);
    if (!opened) return tl::unexpected(opened.error());
    accel.emplace(std::move(*opened));
  }
  log::info("capture", "IIO: gyro of " + gyro->name() + ", accelerometer of " +
                           (accel ? accel->name() : gyro->name()) +
                           (gyro->rate_hz() ? ", " + fixed(*gyro->rate_hz(), 1) + " Hz" : "") +
                           (gyro->is_on_our_clock() ? ", stamped on this machine's clock"
                                                    : ", stamps placed by arrival"));
  return std::make_unique<IioSource>(std::move(*context), std::move(*gyro), std::move(accel),
                                     clock);
}

}  // namespace fiducap
