#include "capture/v4l2/device.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>

#include <linux/videodev2.h>

#include "capture/v4l2/pixel_format.hpp"

namespace fiducap::v4l2 {
namespace {

// No device has more; one that is broken may go on for ever.
constexpr std::uint32_t kMostEntries = 128;

template <std::size_t N>
std::string text_of_bytes(const std::uint8_t (&bytes)[N]) {
  std::string text;
  for (std::size_t i = 0; i < N && bytes[i] != 0; ++i)
    text += bytes[i] >= ' ' && bytes[i] <= '~' ? static_cast<char>(bytes[i]) : '?';
  return text;
}

bool has_planes(const Identity& identity) {
  return identity.buffer_type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
}

double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0 : double{1} * interval.denominator / interval.numerator;
}

v4l2_fract interval_of(double rate_hz) {
  // Thousandths: 29.97 Hz is 1000/29970.
  return {1000, static_cast<std::uint32_t>(std::lround(rate_hz * 1000))};
}

std::vector<OfferedSize> offered_sizes(Port& port, std::uint32_t code, bool& any_between) {
  std::vector<OfferedSize> sizes;
  const auto add = [&](std::uint32_t width, std::uint32_t height) {
    const PixelSize size{static_cast<int>(width), static_cast<int>(height)};
    sizes.push_back({size, offered_rates(port, code, size)});
  };
  for (std::uint32_t i = 0; i < kMostEntries; ++i) {
    v4l2_frmsizeenum entry{};
    entry.index = i;
    entry.pixel_format = code;
    if (port.control(VIDIOC_ENUM_FRAMESIZES, &entry) != 0) break;
    if (entry.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      add(entry.discrete.width, entry.discrete.height);
      continue;
    }
    add(entry.stepwise.min_width, entry.stepwise.min_height);
    add(entry.stepwise.max_width, entry.stepwise.max_height);
    any_between = true;
    break;
  }
  return sizes;
}

double ask_for_rate(Port& port, const Identity& identity, double rate_hz) {
  v4l2_streamparm rate{};
  rate.type = identity.buffer_type;
  if (port.control(VIDIOC_G_PARM, &rate) != 0) return 0;
  if (rate_hz > 0 && (rate.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
    rate.parm.capture.timeperframe = interval_of(rate_hz);
    (void)port.control(VIDIOC_S_PARM, &rate);
  }
  return rate_of(rate.parm.capture.timeperframe);
}

Mode mode_of(const v4l2_format& format, const Identity& identity) {
  if (has_planes(identity)) {
    const auto& pix = format.fmt.pix_mp;
    return {pix.pixelformat,
            {static_cast<int>(pix.width), static_cast<int>(pix.height)},
            pix.plane_fmt[0].bytesperline,
            0};
  }
  const auto& pix = format.fmt.pix;
  return {pix.pixelformat,
          {static_cast<int>(pix.width), static_cast<int>(pix.height)},
          pix.bytesperline,
          0};
}

}  // namespace

std::string size_text(PixelSize size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

Expected<Identity> identify(Port& port, const std::string& device) {
  v4l2_capability said{};
  if (port.control(VIDIOC_QUERYCAP, &said) != 0)
    return fail(ErrorCode::kUnsupported, "is no video device (V4L2)", device);
  Identity identity{text_of_bytes(said.driver), text_of_bytes(said.card),
                    text_of_bytes(said.bus_info), 0};
  const std::uint32_t can =
      (said.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? said.device_caps : said.capabilities;
  if ((can & V4L2_CAP_VIDEO_CAPTURE) != 0) identity.buffer_type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if ((can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0)
    identity.buffer_type = V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  if (identity.buffer_type == 0 || (can & V4L2_CAP_STREAMING) == 0) {
    return fail(ErrorCode::kUnsupported,
                "is a part of \"" + identity.card +
                    "\" that gives no images (metadata, output, codec); its camera has another "
                    "number: `fiducap cameras`",
                device);
  }
  return identity;
}

std::vector<double> offered_rates(Port& port, std::uint32_t code, PixelSize size) {
  std::vector<double> rates_hz;
  for (std::uint32_t i = 0; i < kMostEntries; ++i) {
    v4l2_frmivalenum entry{};
    entry.index = i;
    entry.pixel_format = code;
    entry.width = static_cast<std::uint32_t>(size.width);
    entry.height = static_cast<std::uint32_t>(size.height);
    if (port.control(VIDIOC_ENUM_FRAMEINTERVALS, &entry) != 0) break;
    if (entry.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      rates_hz.push_back(rate_of(entry.discrete));
      continue;
    }
    rates_hz.push_back(rate_of(entry.stepwise.min));
    rates_hz.push_back(rate_of(entry.stepwise.max));
    break;
  }
  std::sort(rates_hz.begin(), rates_hz.end(), std::greater<>());
  return rates_hz;
}

std::vector<OfferedFormat> offered_formats(Port& port, const Identity& identity) {
  std::vector<OfferedFormat> formats;
  for (std::uint32_t i = 0; i < kMostEntries; ++i) {
    v4l2_fmtdesc entry{};
    entry.index = i;
    entry.type = identity.buffer_type;
    if (port.control(VIDIOC_ENUM_FMT, &entry) != 0) break;
    OfferedFormat format{entry.pixelformat, text_of_bytes(entry.description)};
    format.sizes = offered_sizes(port, format.code, format.any_size_between);
    formats.push_back(std::move(format));
  }
  return formats;
}

std::optional<Mode> current_mode(Port& port, const Identity& identity) {
  v4l2_format format{};
  format.type = identity.buffer_type;
  if (port.control(VIDIOC_G_FMT, &format) != 0) return std::nullopt;
  Mode mode = mode_of(format, identity);
  mode.rate_hz = ask_for_rate(port, identity, 0);
  return mode;
}

Expected<Mode> ask_for_mode(Port& port, const Identity& identity, std::uint32_t code,
                            PixelSize size, double rate_hz) {
  v4l2_format format{};
  format.type = identity.buffer_type;
  if (has_planes(identity)) {
    format.fmt.pix_mp.width = static_cast<std::uint32_t>(size.width);
    format.fmt.pix_mp.height = static_cast<std::uint32_t>(size.height);
    format.fmt.pix_mp.pixelformat = code;
    format.fmt.pix_mp.field = V4L2_FIELD_NONE;
  } else {
    format.fmt.pix.width = static_cast<std::uint32_t>(size.width);
    format.fmt.pix.height = static_cast<std::uint32_t>(size.height);
    format.fmt.pix.pixelformat = code;
    format.fmt.pix.field = V4L2_FIELD_NONE;
  }
  if (const int error = port.control(VIDIOC_S_FMT, &format); error != 0) {
    return fail(ErrorCode::kUnavailable, "does not take the format " + code_text(code) + " at " +
                                             size_text(size) + ": " + std::strerror(error));
  }
  Mode mode = mode_of(format, identity);
  mode.rate_hz = ask_for_rate(port, identity, rate_hz);
  return mode;
}

}  // namespace fiducap::v4l2
