#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace fiducap::vicon {

/// Numbers frames by the time they are for: number = time · rate, so that a frame that was never made leaves a gap and
/// clients may compute time as number / rate. Strictly ascending all the same; starts again at 0 after 2^31 frames, so
/// that clients that keep it in an int stay right.
class FrameNumbers final {
 public:
  /// @pre rate_hz > 0
  [[nodiscard]] std::uint32_t next(Instant at, double rate_hz);

 private:
  std::optional<Instant> start_;
  double rate_hz_{0};
  std::int64_t first_{0};
  std::int64_t next_{0};
};

}  // namespace fiducap::vicon
