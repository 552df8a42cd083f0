#include "capture/v4l2/v4l2_port.hpp"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

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
      return "there is no such device (any more); `fiducap cameras` lists those that are there";
    case EACCES:
    case EPERM:
      return "this user may not; as root: usermod -aG video USER, then log in again";
    case EBUSY:
      return "another program holds it; `fuser -v` with its name says which";
    default:
      return std::strerror(error);
  }
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

}  // namespace fiducap::v4l2
