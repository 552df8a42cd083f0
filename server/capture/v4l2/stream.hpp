#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/v4l2/device.hpp"
#include "capture/v4l2/pixel_format.hpp"

namespace fiducap::v4l2 {

struct KernelStamp {
  std::int64_t ns{};
  bool is_monotonic{};  ///< On the server's clock.
  bool marks_start{};   ///< Start of exposure, else the end of the frame.
};

/// A buffer that the driver filled. Its bytes are valid until it is given back.
struct FilledBuffer {
  std::uint32_t index{};
  std::span<const std::byte> bytes{};
  KernelStamp stamp{};
  std::uint32_t sequence{};
  bool damaged{};  ///< The driver reports missing or wrong pixels.
};

/// Image buffers shared with the device, filled from `start` until destruction.
class Stream final {
 public:
  /// @param port  outlives it
  [[nodiscard]] static Expected<std::unique_ptr<Stream>> start(Port& port,
                                                               const Identity& identity);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// The oldest filled buffer; nullopt when none comes `within`.
  /// @return Error when the device is lost, or after repeated failures
  [[nodiscard]] Expected<std::optional<FilledBuffer>> take(Duration within);
  /// The driver may fill it again.
  void give_back(const FilledBuffer& buffer) {
    if (queue(buffer.index) != 0) unqueued_.push_back(buffer.index);
  }

 private:
  static constexpr std::uint32_t kBuffers = 4;  ///< Images queued while the reader is busy.
  struct Request;

  Stream(Port& port, const Identity& identity) : port_(port), identity_(identity) {}
  [[nodiscard]] Expected<void> map_buffers();
  [[nodiscard]] Expected<void> begin();
  [[nodiscard]] int queue(std::uint32_t index);  ///< 0 or errno

  Port& port_;
  Identity identity_;
  std::vector<std::span<std::byte>> memory_;
  std::vector<std::uint32_t> unqueued_;  ///< Given back, but refused by the driver.
  int failures_{0};                      ///< In a row.
  bool flows_{false};
};

struct ModeRequest {
  const PixelFormat* format{nullptr};  ///< nullptr: the fastest.
  PixelSize size{};                    ///< 0 x 0: the present one.
  double rate_hz{0};                   ///< 0: the highest.
  bool waits_for_trigger{false};       ///< Images may be far apart: nothing is measured.
};

/// A mode that is set, and streams.
struct ChosenMode {
  Mode mode{};
  const PixelFormat* format{};
  double measured_hz{0};  ///< 0: not measured.
  std::string others{};   ///< Other formats of this size, with their rates.
  std::unique_ptr<Stream> stream{};
};

/// Chooses the format with the highest measured rate at the requested size. Measures at most three,
/// for half a second each, by falling nominal rate, which ends at the best measured one.
[[nodiscard]] Expected<ChosenMode> choose_mode(Port& port, const Identity& identity,
                                               const ModeRequest& request, const Clock& clock);

}  // namespace fiducap::v4l2
