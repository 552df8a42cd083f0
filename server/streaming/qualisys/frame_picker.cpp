#include "streaming/qualisys/frame_picker.hpp"

namespace fiducap::qualisys {

bool FramePicker::wants(const SceneFrame& frame) {
  switch (rate_.kind) {
    case RateKind::kAllFrames:
      return true;
    case RateKind::kFrequencyDivisor:
      if (!first_) first_ = frame.number;
      return (frame.number - *first_) % rate_.n == 0;
    case RateKind::kFrequency:
      break;
  }
  // A schedule of its own, on the frames' clock: 60 of 100 frames per second are the nearest ones,
  // and no rounding adds up. After a pause it starts anew instead of catching up.
  const Duration period{1'000'000'000 / rate_.n};
  const Duration half_a_frame{frame.rate_hz > 0 ? static_cast<std::int64_t>(0.5e9 / frame.rate_hz)
                                                : 0};
  if (due_ && frame.at + half_a_frame < *due_) return false;
  const bool late = !due_ || frame.at - *due_ > period;
  due_ = (late ? frame.at : *due_) + period;
  return true;
}

}  // namespace fiducap::qualisys
