// Apart from the sockets: the kernel's termios, which knows any rate, and the C library's exclude
// each other.
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

constexpr double kRateTolerance = 0.03;  // what 8N1 bears

tl::unexpected<Error> cannot_open(const std::string& device, int reason) {
  switch (reason) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return fail(
          ErrorCode::kNotFound,
          "there is no such serial device: is it plugged in? /dev/serial/by-id/ names those "
          "that are",
          device);
    case EACCES:
    case EPERM:
      return fail(ErrorCode::kUnavailable,
                  "this user may not open the serial device: add it to the group dialout", device);
    case EBUSY:
    case EWOULDBLOCK:
      return fail(
          ErrorCode::kUnavailable,
          "another program has the serial device: close it (a serial monitor? ModemManager?)",
          device);
    default:
      return fail(ErrorCode::kUnavailable,
                  std::string("the serial device cannot be opened: ") + std::strerror(reason),
                  device);
  }
}

/// What makes its bytes come at once, where the driver can: FTDI's chips wait up to 16 ms
/// otherwise.
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
  // Without HUPCL: closing it does not lower DTR, which would reset a board when it is opened
  // again.
  line.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
  line.c_ispeed = line.c_ospeed = static_cast<speed_t>(baud);
  line.c_cc[VMIN] = 1;
  line.c_cc[VTIME] = 0;
  if (ioctl(descriptor, TCSETS2, &line) != 0 || ioctl(descriptor, TCGETS2, &line) != 0) {
    return fail(ErrorCode::kUnsupported,
                "the serial device does not take " + std::to_string(baud) + " baud, 8N1", device);
  }
  if (std::abs(static_cast<double>(line.c_ospeed) - baud) > kRateTolerance * baud) {
    return fail(ErrorCode::kUnsupported,
                "the serial device does " + std::to_string(line.c_ospeed) + " baud instead of " +
                    std::to_string(baud) + ": use a rate that it can do",
                device);
  }
  ask_for_low_latency(descriptor);
  ioctl(descriptor, TCFLSH, TCIFLUSH);
  return {};
}

}  // namespace

Expected<int> open_serial_port(const std::string& device, int baud) {
  const int descriptor = ::open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) return cannot_open(device, errno);
  // Two locks, for root may pass the first; the second only binds who asks.
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
