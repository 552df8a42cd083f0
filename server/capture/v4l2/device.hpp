#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/encoded_size.hpp"
#include "capture/v4l2/v4l2_port.hpp"

namespace fiducap::v4l2 {

/// What a video device says of itself.
struct Identity {
  std::string driver;           ///< `uvcvideo`
  std::string card;             ///< `HD Pro Webcam C920`
  std::string bus;              ///< `usb-0000:00:14.0-2`
  std::uint32_t buffer_type{};  ///< V4L2_BUF_TYPE_VIDEO_CAPTURE or …_MPLANE.
};

/// @return Error when it is no camera that streams: the node of an output, of metadata, of a codec
[[nodiscard]] Expected<Identity> identify(Port& port, const std::string& device);

/// One size and how often, at most, the device promises an image of it.
struct OfferedSize {
  PixelSize size{};
  std::vector<double> rates_hz{};  ///< Falling; empty: it does not say.
};

struct OfferedFormat {
  std::uint32_t code{};
  std::string description{};
  std::vector<OfferedSize> sizes{};  ///< Of a range of sizes the ends.
  bool any_size_between{false};
};

/// All that the device offers, in its order; bounded, whatever it says.
[[nodiscard]] std::vector<OfferedFormat> offered_formats(Port& port, const Identity& identity);
[[nodiscard]] std::vector<double> offered_rates(Port& port, std::uint32_t code, PixelSize size);

/// What is set now.
struct Mode {
  std::uint32_t code{};
  PixelSize size{};
  std::size_t stride{};
  double rate_hz{};  ///< 0: the device does not say.
};

/// nullopt: the device does not say.
[[nodiscard]] std::optional<Mode> current_mode(Port& port, const Identity& identity);
/// Asks for a mode. @param rate_hz  0: as it comes
/// @return what the device made of it, which may be another size, format or rate; Error: errno
[[nodiscard]] Expected<Mode> ask_for_mode(Port& port, const Identity& identity, std::uint32_t code,
                                          PixelSize size, double rate_hz);

[[nodiscard]] std::string size_text(PixelSize size);

}  // namespace fiducap::v4l2
