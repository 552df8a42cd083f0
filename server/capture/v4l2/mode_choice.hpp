#pragma once

#include <memory>
#include <string>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/v4l2/device.hpp"
#include "capture/v4l2/pixel_format.hpp"
#include "capture/v4l2/stream.hpp"

namespace fiducap::v4l2 {

struct ModeWish {
  const PixelFormat* format{nullptr};  ///< nullptr: the quickest.
  PixelSize size{};                    ///< 0 x 0: as it comes.
  double rate_hz{0};                   ///< 0: the highest.
  bool waits_for_trigger{false};       ///< Images may be far apart: nothing is measured.
};

/// A mode that is set, and streams.
struct ChosenMode {
  Mode mode{};
  const PixelFormat* format{};
  double measured_hz{0};  ///< 0: not measured.
  std::string others{};   ///< What else the device offers at this size, and how quickly.
  std::unique_ptr<Stream> stream{};
};

/// Tries what the device offers at the wished size, those that promise most first, and keeps what
/// delivers most images per second, measured over half a second; three at most. What promises
/// less than another one delivers is not tried.
[[nodiscard]] Expected<ChosenMode> choose_mode(Port& port, const Identity& identity,
                                               const ModeWish& wish, const Clock& clock);

}  // namespace fiducap::v4l2
