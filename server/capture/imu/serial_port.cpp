// Apart: the kernel's termios, which supports any rate, excludes that of the C library.
#include <asm/termbits.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>

#include "capture/imu/byte_link.hpp"

namespace fiducap {
namespace {

constexpr double kRateTolerance = 0.03;  // tolerance of 8N1

tl::unexpected<Error> cannot_open(const std::string& device, int reason) {
  switch (reason) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return fail(ErrorCode::kNotFound,
                  "there is no such serial device: is it plugged in? /dev/serial/by-id/ lists the "
                  "present ones",
                  device);
    case EACCES:
    case EPERM:
      return fail(ErrorCode::kUnavailable,
                  "this user may not open the serial device: add it to the group dialout", device);
    case EBUSY:
    case EWOULDBLOCK:
      return fail(
          ErrorCode::kUnavailable,
          "another program uses the serial device: close it (a serial monitor? ModemManager?)",
          device);
    default:
      return fail(ErrorCode::kUnavailable,
                  std::string("the serial device cannot be opened: ") + std::strerror(reason),
                  device);
  }
}

/// If the driver supports it; FTDI's chips delay bytes by up to 16 ms otherwise.
void ask_for_low_latency(int descriptor) {
  serial_struct settings{};
  if (ioctl(descriptor, TIOCGSERIAL, &settings) != 0) return;
  settings.flags |= ASYNC_LOW_LATENCY;
  ioctl(descriptor, TIOCSSERIAL, &settings);
}

Expected<void> set_up(int descriptor, const std::string& device, int baud) {
  termios2 line{};
  if (ioctl(descriptor, TCGETS2, &line) != 0)
    return fail(ErrorCode::kInvalid, "is no serial device", device);
  line.c_iflag = IGNBRK;
  line.c_oflag = 0;
  line.c_lflag = 0;
  // Without HUPCL: closing does not lower DTR, so the next opening does not reset a board.
  line.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
  line.c_ispeed = line.c_ospeed = static_cast<speed_t>(baud);
  line.c_cc[VMIN] = 1;
  line.c_cc[VTIME] = 0;
  if (ioctl(descriptor, TCSETS2, &line) != 0 || ioctl(descriptor, TCGETS2, &line) != 0)
    return fail(ErrorCode::kUnsupported,
                "the serial device does not support " + std::to_string(baud) + " baud, 8N1",
                device);
  if (std::abs(static_cast<double>(line.c_ospeed) - baud) > kRateTolerance * baud)
    return fail(ErrorCode::kUnsupported,
                "the serial device uses " + std::to_string(line.c_ospeed) + " baud instead of " +
                    std::to_string(baud) + ": use a rate that it supports",
                device);
  ask_for_low_latency(descriptor);
  ioctl(descriptor, TCFLSH, TCIFLUSH);
  return {};
}

}  // namespace

Expected<int> open_serial_port(const std::string& device, int baud) {
  const int descriptor = ::open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) return cannot_open(device, errno);
  // Two locks: root ignores TIOCEXCL, and flock is advisory.
  const bool is_ours =
      ::flock(descriptor, LOCK_EX | LOCK_NB) == 0 && ioctl(descriptor, TIOCEXCL) == 0;
  const int reason = errno;
  const auto ready = is_ours || reason == ENOTTY ? set_up(descriptor, device, baud)
                                                 : Expected<void>(cannot_open(device, reason));
  if (ready) return descriptor;
  ::close(descriptor);
  return tl::unexpected(ready.error());
}

}  // namespace fiducap
