#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/v4l2/device.hpp"
#include "capture/v4l2/v4l2_port.hpp"

namespace fiducap::v4l2 {

/// What the kernel says of when an image was taken.
struct KernelStamp {
  std::int64_t ns{};
  bool is_monotonic{};  ///< On the clock that the server counts by.
  bool marks_start{};   ///< Start of exposure, else the end of the frame.
};

/// A buffer that the driver filled. Its bytes are valid until it is given back.
struct FilledBuffer {
  std::uint32_t index{};
  std::span<const std::byte> bytes{};
  KernelStamp stamp{};
  std::uint32_t sequence{};
  bool damaged{};  ///< The driver says that pixels are missing or wrong.
};

/// Images flow from the device into buffers that it shares with us, from `start` until it dies.
class Stream final {
 public:
  /// @param port  outlives it
  [[nodiscard]] static Expected<std::unique_ptr<Stream>> start(Port& port,
                                                               const Identity& identity);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// The oldest filled buffer; nullopt when none comes `within`.
  /// @return Error when the device is lost, or gives nothing but failures
  [[nodiscard]] Expected<std::optional<FilledBuffer>> take(Duration within);
  /// It may be filled again.
  void give_back(const FilledBuffer& buffer);

 private:
  static constexpr std::uint32_t kBuffers = 4;  ///< So many may wait while the reader is busy.
  struct Request;

  Stream(Port& port, const Identity& identity) : port_(port), identity_(identity) {}
  [[nodiscard]] Expected<void> map_buffers();
  [[nodiscard]] Expected<void> begin();
  [[nodiscard]] int queue(std::uint32_t index);  ///< 0 or errno
  [[nodiscard]] Expected<std::optional<FilledBuffer>> no_buffer(int error);

  Port& port_;
  Identity identity_;
  std::vector<std::span<std::byte>> memory_;
  std::vector<std::uint32_t> unqueued_;  ///< Given back, but the driver did not take them.
  int failures_{0};                      ///< In a row.
  bool flows_{false};
};

}  // namespace fiducap::v4l2
