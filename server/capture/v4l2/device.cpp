#include "capture/v4l2/device.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <functional>

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "capture/v4l2/pixel_format.hpp"

namespace fiducap::v4l2 {
namespace {

class KernelPort final : public Port {
 public:
  explicit KernelPort(int descriptor) : descriptor_(descriptor) {}
  ~KernelPort() override { ::close(descriptor_); }
  KernelPort(const KernelPort&) = delete;
  KernelPort& operator=(const KernelPort&) = delete;

  int control(unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ::ioctl(descriptor_, request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }
  std::span<std::byte> map(std::size_t length, std::uint32_t offset) override {
    void* memory =
        ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, off_t{offset});
    if (memory == MAP_FAILED) return {};
    return {static_cast<std::byte*>(memory), length};
  }
  void unmap(std::span<std::byte> memory) override { ::munmap(memory.data(), memory.size()); }
  Ready wait(Duration at_most) override {
    pollfd what{descriptor_, POLLIN, 0};
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(at_most).count();
    const int ready = ::poll(&what, 1, static_cast<int>(ms));
    if (ready < 0) return errno == EINTR ? Ready::kNothing : Ready::kBroken;
    if (ready == 0) return Ready::kNothing;
    return (what.revents & POLLIN) != 0 ? Ready::kImage : Ready::kBroken;
  }

 private:
  int descriptor_;
};

std::string why_not(int error) {
  switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return "no such device (any more); `fiducap cameras` lists the present ones";
    case EACCES:
    case EPERM:
      return "no permission; as root: usermod -aG video USER, then log in again";
    case EBUSY:
      return "it is used by another program; find it with `fuser -v` and its name";
    default:
      return std::strerror(error);
  }
}

// More than any device has; broken ones may list without end.
constexpr std::uint32_t kMostEntries = 128;

bool has_planes(const Identity& identity) {
  return identity.buffer_type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
}

double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0 : double{1} * interval.denominator / interval.numerator;
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

double request_rate(Port& port, const Identity& identity, double rate_hz) {
  v4l2_streamparm rate{};
  rate.type = identity.buffer_type;
  if (port.control(VIDIOC_G_PARM, &rate) != 0) return 0;
  if (rate_hz > 0 && (rate.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
    // Thousandths: 29.97 Hz is 1000/29970.
    rate.parm.capture.timeperframe = {1000,
                                      static_cast<std::uint32_t>(std::lround(rate_hz * 1000))};
    (void)port.control(VIDIOC_S_PARM, &rate);
  }
  return rate_of(rate.parm.capture.timeperframe);
}

/// Calls `use` with the pixel format of one or several planes.
template <typename Format, typename Use>
void with_pixels(Format& format, const Identity& identity, Use&& use) {
  if (has_planes(identity))
    use(format.fmt.pix_mp);
  else
    use(format.fmt.pix);
}

Mode mode_of(const v4l2_format& format, const Identity& identity) {
  Mode mode;
  with_pixels(format, identity, [&mode](const auto& pix) {
    mode.code = pix.pixelformat;
    mode.size = {static_cast<int>(pix.width), static_cast<int>(pix.height)};
  });
  mode.stride = has_planes(identity) ? format.fmt.pix_mp.plane_fmt[0].bytesperline
                                     : format.fmt.pix.bytesperline;
  return mode;
}

}  // namespace

Expected<std::unique_ptr<Port>> open_port(const std::string& device) {
  const int descriptor = ::open(device.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) {
    const int error = errno;
    const bool is_there = error != ENOENT && error != ENODEV && error != ENXIO;
    return fail(is_there ? ErrorCode::kUnavailable : ErrorCode::kNotFound,
                "cannot be opened: " + why_not(error), device);
  }
  return std::make_unique<KernelPort>(descriptor);
}

std::string text_of_field(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes.size() && bytes[i] != 0; ++i)
    text += bytes[i] >= ' ' && bytes[i] <= '~' ? static_cast<char>(bytes[i]) : '?';
  return text;
}

Expected<Identity> identify(Port& port, const std::string& device) {
  v4l2_capability capability{};
  if (port.control(VIDIOC_QUERYCAP, &capability) != 0)
    return fail(ErrorCode::kUnsupported, "is no video device (V4L2)", device);
  Identity identity{text_of_field(capability.driver), text_of_field(capability.card),
                    text_of_field(capability.bus_info), 0};
  const std::uint32_t can = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                ? capability.device_caps
                                : capability.capabilities;
  if ((can & V4L2_CAP_VIDEO_CAPTURE) != 0) identity.buffer_type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if ((can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0)
    identity.buffer_type = V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  if (identity.buffer_type == 0 || (can & V4L2_CAP_STREAMING) == 0)
    return fail(ErrorCode::kUnsupported,
                "is a part of \"" + identity.card +
                    "\" without images (metadata, output, codec); its camera has another number: "
                    "`fiducap cameras`",
                device);
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
  std::ranges::sort(rates_hz, std::greater<>());
  return rates_hz;
}

std::vector<OfferedFormat> offered_formats(Port& port, const Identity& identity) {
  std::vector<OfferedFormat> formats;
  for (std::uint32_t i = 0; i < kMostEntries; ++i) {
    v4l2_fmtdesc entry{};
    entry.index = i;
    entry.type = identity.buffer_type;
    if (port.control(VIDIOC_ENUM_FMT, &entry) != 0) break;
    OfferedFormat format{entry.pixelformat, text_of_field(entry.description)};
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
  mode.rate_hz = request_rate(port, identity, 0);
  return mode;
}

Expected<Mode> request_mode(Port& port, const Identity& identity, std::uint32_t code,
                            PixelSize size, double rate_hz) {
  v4l2_format format{};
  format.type = identity.buffer_type;
  with_pixels(format, identity, [&](auto& pix) {
    pix.width = static_cast<std::uint32_t>(size.width);
    pix.height = static_cast<std::uint32_t>(size.height);
    pix.pixelformat = code;
    pix.field = V4L2_FIELD_NONE;
  });
  if (const int error = port.control(VIDIOC_S_FMT, &format); error != 0)
    return fail(ErrorCode::kUnavailable, "refuses the format " + code_text(code) + " at " +
                                             size_text(size) + ": " + std::strerror(error));
  Mode mode = mode_of(format, identity);
  mode.rate_hz = request_rate(port, identity, rate_hz);
  return mode;
}

}  // namespace fiducap::v4l2
