#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/gray_image.hpp"

namespace fiducap::v4l2 {

/// The system calls of one open video device, which the destructor closes; an interface for tests.
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

/// @return Error with reason and remedy
[[nodiscard]] Expected<std::unique_ptr<Port>> open_port(const std::string& device);

/// A video device as it identifies itself.
struct Identity {
  std::string driver;           ///< `uvcvideo`
  std::string card;             ///< `HD Pro Webcam C920`
  std::string bus;              ///< `usb-0000:00:14.0-2`
  std::uint32_t buffer_type{};  ///< V4L2_BUF_TYPE_VIDEO_CAPTURE or …_MPLANE.
};

/// @return Error when it is no streaming camera: the node of an output, of metadata, of a codec
[[nodiscard]] Expected<Identity> identify(Port& port, const std::string& device);

struct OfferedSize {
  PixelSize size{};
  std::vector<double> rates_hz{};  ///< Nominal maxima, falling; empty: not known.
};

struct OfferedFormat {
  std::uint32_t code{};
  std::string description{};
  std::vector<OfferedSize> sizes{};  ///< Of a range of sizes the ends.
  bool any_size_between{false};
};

/// All that the device offers, in its order; bounded.
[[nodiscard]] std::vector<OfferedFormat> offered_formats(Port& port, const Identity& identity);
[[nodiscard]] std::vector<double> offered_rates(Port& port, std::uint32_t code, PixelSize size);

struct Mode {
  std::uint32_t code{};
  PixelSize size{};
  std::size_t stride{};
  double rate_hz{};  ///< 0: not known.
};

/// nullopt: not known.
[[nodiscard]] std::optional<Mode> current_mode(Port& port, const Identity& identity);
/// Requests a mode. @param rate_hz  0: not changed
/// @return the actual mode, which may have another size, format or rate; Error: errno
[[nodiscard]] Expected<Mode> request_mode(Port& port, const Identity& identity, std::uint32_t code,
                                          PixelSize size, double rate_hz);

/// Text of a field of the kernel, up to the first zero; unprintable characters as '?'.
[[nodiscard]] std::string text_of_field(std::span<const std::uint8_t> bytes);

}  // namespace fiducap::v4l2
