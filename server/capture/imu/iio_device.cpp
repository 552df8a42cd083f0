#include "capture/imu/iio_device.hpp"

#include <iio.h>

#include <cerrno>
#include <cmath>
#include <cstring>

#include "base/log.hpp"
#include "base/text.hpp"
#include "capture/imu/mount_matrix.hpp"

namespace fiducap::iio {

namespace {

// Local: so long a stop may take to be seen. Over a network a session does not survive a time-out.
constexpr unsigned kLocalPatience_ms = 300;
constexpr unsigned kNetworkPatience_ms = 2000;
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
  for (const char* own :
       {iio_device_get_name(device), iio_device_get_label(device), iio_device_get_id(device)}) {
    if (own != nullptr && name == own) return true;
  }
  return false;
}

std::optional<std::string> read_text(const iio_device* device, const char* attribute) {
  std::array<char, kLongestText> text{};
  if (iio_device_attr_read(device, attribute, text.data(), text.size()) <= 0) return std::nullopt;
  return std::string(text.data());
}

std::optional<std::string> read_text(const iio_channel* channel, const char* attribute) {
  std::array<char, kLongestText> text{};
  if (iio_channel_attr_read(channel, attribute, text.data(), text.size()) <= 0) return std::nullopt;
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
       {read_text(channel, "mount_matrix"),
        read_text(device, ("in_" + kind + "_mount_matrix").c_str()),
        read_text(device, "in_mount_matrix"), read_text(device, "mount_matrix")}) {
    if (!text) continue;
    const auto matrix = parse_mount_matrix(*text);
    if (matrix) return *matrix;
    log::warning("capture", name_of_device(device) + ": its mount_matrix (" + *text +
                                ") is no turn and is not used");
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

}  // namespace

void Context::Close::operator()(iio_context* context) const { iio_context_destroy(context); }
void Device::Destroy::operator()(iio_buffer* buffer) const { iio_buffer_destroy(buffer); }

Expected<Context> Context::open(const std::string& uri) {
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

bool Context::is_local() const {
  return std::string_view(iio_context_get_name(context_.get())) == "local";
}

Expected<iio_device*> Context::find(const std::string& name, const char* channel) const {
  std::string all;
  for (unsigned i = 0; i < iio_context_get_devices_count(context_.get()); ++i) {
    iio_device* device = iio_context_get_device(context_.get(), i);
    const bool has_channel = iio_device_find_channel(device, channel, false) != nullptr;
    if (has_channel && (name.empty() || is_called(device, name))) return device;
    all += (all.empty() ? "" : ", ") + name_of_device(device) + (has_channel ? "" : " (has none)");
  }
  return fail(ErrorCode::kNotFound, "there is no IIO device " + name + (name.empty() ? "" : " ") +
                                        "with a channel " + channel +
                                        "; there are: " + (all.empty() ? "none" : all));
}

iio_device* Context::find_trigger(const std::string& name) const {
  return iio_context_find_device(context_.get(), name.c_str());
}

Expected<Device> Device::open(const Context& context, iio_device* device, Wanted wanted,
                              const IioConfig& config) {
  Device made(device, name_of_device(device));
  made.is_local_ = context.is_local();
  // Enabled channels are of whoever had the device before.
  for (unsigned i = 0; i < iio_device_get_channels_count(device); ++i)
    iio_channel_disable(iio_device_get_channel(device, i));
  auto gyro = made.find_triad(wanted.gyro, "anglvel");
  auto accel = made.find_triad(wanted.accel, "accel");
  for (const auto* triad : {&gyro, &accel}) {
    if (!*triad) return tl::unexpected(triad->error());
    if (auto enabled = made.enable(**triad); !enabled) return tl::unexpected(enabled.error());
  }
  made.gyro_ = *gyro;
  made.accel_ = *accel;
  made.stamp_ = iio_device_find_channel(device, "timestamp", false);
  if (made.stamp_ == nullptr)
    return fail(ErrorCode::kUnsupported, "has no timestamp channel: its readings have no time",
                made.name_);
  iio_channel_enable(made.stamp_);
  if (auto set = made.set_trigger(context, config.trigger); !set)
    return tl::unexpected(set.error());
  made.set_rate(config.rate_hz);
  made.set_clock(made.is_local_);
  iio_context_set_timeout(const_cast<iio_context*>(iio_device_get_context(device)),
                          made.is_local_ ? kLocalPatience_ms : kNetworkPatience_ms);
  made.buffer_.reset(
      iio_device_create_buffer(device, static_cast<std::size_t>(config.samples), false));
  if (made.buffer_) return made;
  const int reason = errno;
  return fail(ErrorCode::kUnavailable,
              "its buffer does not start (" + reason_of(reason) +
                  "): has another program got it, may this user open /dev/iio:device*, and does it "
                  "need a trigger (`trigger`, e.g. of iio-trig-hrtimer)?",
              made.name_);
}

Expected<std::optional<Device::Triad>> Device::find_triad(bool wanted, const char* kind) const {
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

Expected<void> Device::enable(const std::optional<Triad>& triad) const {
  if (!triad) return {};
  for (iio_channel* channel : triad->channels) {
    if (!iio_channel_is_scan_element(channel))
      return fail(ErrorCode::kUnsupported,
                  "cannot be read in buffers: its driver has none. Readings without them have no "
                  "time",
                  name_);
    iio_channel_enable(channel);
  }
  return {};
}

Expected<void> Device::set_trigger(const Context& context, const std::string& name) const {
  if (name.empty()) return {};
  const iio_device* trigger = context.find_trigger(name);
  if (trigger == nullptr || !iio_device_is_trigger(trigger))
    return fail(ErrorCode::kNotFound, "there is no trigger " + name, name_);
  const int result = iio_device_set_trigger(device_, trigger);
  if (result == 0) return {};
  return fail(ErrorCode::kUnavailable,
              "does not take the trigger " + name + " (" + reason_of(result) + ")", name_);
}

/// Of the sensor, or of the whole device. What it really does is said when it is something else.
void Device::set_rate(double rate_hz) {
  constexpr const char* kRate = "sampling_frequency";
  for (const auto& triad : {gyro_, accel_}) {
    if (!triad) continue;
    iio_channel* channel = triad->channels[0];
    const bool is_own = iio_channel_find_attr(channel, kRate) != nullptr;
    if (rate_hz > 0 && is_own) iio_channel_attr_write_double(channel, kRate, rate_hz);
    if (rate_hz > 0 && !is_own) iio_device_attr_write_double(device_, kRate, rate_hz);
    double given = 0;
    const bool is_told = is_own ? iio_channel_attr_read_double(channel, kRate, &given) == 0
                                : iio_device_attr_read_double(device_, kRate, &given) == 0;
    if (is_told) rate_hz_ = given;
    const bool is_met = is_told && std::abs(given - rate_hz) <= kRateTolerance * rate_hz;
    if (rate_hz <= 0 || is_met) continue;
    const auto offered = is_own ? read_text(channel, "sampling_frequency_available")
                                : read_text(device_, "sampling_frequency_available");
    log::warning("capture", name_ + ": " +
                                (is_told ? "does " + fixed(given, 1) + " Hz instead of "
                                         : std::string("does not say its rate, asked for ")) +
                                fixed(rate_hz, 1) + " Hz" +
                                (offered ? "; it offers " + *offered : std::string()));
  }
}

/// The kernel stamps with the wall clock unless told otherwise, which NTP moves.
void Device::set_clock(bool is_local) {
  constexpr const char* kClock = "current_timestamp_clock";
  iio_device_attr_write(device_, kClock, "monotonic");
  const auto clock = read_text(device_, kClock);
  const bool is_monotonic =
      clock && clock->starts_with("monotonic") && !clock->starts_with("monotonic_");
  is_on_our_clock_ = is_local && is_monotonic;
  if (is_local && !is_monotonic)
    log::warning("capture", name_ + ": its stamps are of the clock " + clock.value_or("?") +
                                " and cannot be set to monotonic: they are placed by arrival");
}

Expected<bool> Device::refill() {
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
    iio_channel_convert(stamp_, &reading.stamp_ns, stamps + static_cast<std::ptrdiff_t>(k) * step);
    if (gyro_) reading.w = read(*gyro_, k);
    if (accel_) reading.f = read(*accel_, k);
  }
  return count > 0;
}

Eigen::Vector3d Device::read(const Triad& triad, std::size_t k) const {
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

}  // namespace fiducap::iio
