#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "capture/gray_image.hpp"
#include "capture/v4l2/device.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::v4l2 {

/// A V4L2 device on a clock that it advances: it exposes at its rate, fills its buffers, stamps
/// them, and fails on request. Replies as a kernel to every call that the server makes, and with
/// EINVAL or ENOTTY to others.
class SimulatedCamera final {
 public:
  struct Offer {
    std::uint32_t code{};
    PixelSize size{};
    double promised_hz{};
    double true_hz{};
  };
  struct Knob {
    std::string name;
    std::int32_t minimum{}, maximum{}, value{};
    std::uint32_t type{1};  ///< V4L2_CTRL_TYPE_INTEGER
    std::int32_t step{1};
    std::set<std::int32_t> choices{};  ///< Of a menu.
  };

  explicit SimulatedCamera(FakeClock& fake_clock) : clock(fake_clock) {}

  FakeClock& clock;
  std::string driver{"simulated"};
  std::uint32_t capabilities{0x04000001};  ///< Capture, streaming.
  std::vector<Offer> offers;
  std::map<std::uint32_t, Knob> knobs;
  std::uint32_t stamp_flags{0x00002000};  ///< Monotonic, end of frame.
  Duration stamp_offset{0};               ///< Of the driver's clock.
  std::vector<std::uint8_t> jpeg;         ///< Content of each MJPEG image.
  std::size_t row_padding{0};

  // Faults.
  std::set<std::uint32_t> skipped;    ///< Numbers of images that are lost, …
  std::set<std::uint32_t> damaged;    ///< … that have the error flag of the driver,
  std::set<std::uint32_t> shortened;  ///< … of which half is missing.
  std::set<std::uint32_t> repeated_stamps;
  std::uint32_t first_sequence{0};
  std::optional<std::uint32_t> stops_at;      ///< No image from this number on.
  std::optional<std::uint32_t> unplugged_at;  ///< Every call fails from this number on.
  int dqbuf_failures{0};                      ///< Number of EIO.
  int qbuf_failures{0};                       ///< Not counted while the stream starts.

  // Counters.
  int streams{0};
  int mapped{0};
  std::uint32_t image{0};  ///< Number of the next one since the first stream.
  Offer mode{};
  std::map<std::uint32_t, std::int32_t> set;  ///< Controls that were set.

  [[nodiscard]] std::unique_ptr<Port> open();

 private:
  class Device;
};

}  // namespace fiducap::v4l2
