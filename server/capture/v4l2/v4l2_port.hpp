#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/expected.hpp"
#include "base/time.hpp"

namespace fiducap::v4l2 {

/// The system calls of one open video device. Closed when it dies.
class Port {
 public:
  enum class Ready { kImage, kNothing, kBroken };

  virtual ~Port() = default;
  /// ioctl. @return 0, or errno
  [[nodiscard]] virtual int control(unsigned long request, void* argument) = 0;
  /// Memory of a buffer that the driver fills; empty when it cannot be mapped.
  [[nodiscard]] virtual std::span<std::byte> map(std::size_t length, std::uint32_t offset) = 0;
  virtual void unmap(std::span<std::byte> memory) = 0;
  /// Waits for a filled buffer.
  [[nodiscard]] virtual Ready wait(Duration at_most) = 0;
};

/// @return Error saying why not, and what to do
[[nodiscard]] Expected<std::unique_ptr<Port>> open_port(const std::string& device);

}  // namespace fiducap::v4l2
