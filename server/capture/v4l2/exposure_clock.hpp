#pragma once

#include <optional>
#include <string>

#include "base/time.hpp"
#include "capture/v4l2/stream.hpp"

namespace fiducap::v4l2 {

/// What a stamp marks.
enum class StampMark { kStartOfExposure, kFirstBytes, kEndOfFrame, kArrival };

/// @param driver             uvcvideo says "start of exposure" of the moment when the first bytes
///                           of an image come, unless it counts by the camera's own clock
/// @param by_cameras_clock   its parameter `hwtimestamps`
[[nodiscard]] StampMark mark_of(const KernelStamp& stamp, const std::string& driver,
                                bool by_cameras_clock);
/// For a log: `the kernel's, when an image begins to arrive`.
[[nodiscard]] std::string words_for(StampMark mark);

/// Makes of stamps the middle of the exposure.
class ExposureClock final {
 public:
  struct Delays {
    Duration exposure{0};
    Duration latency{0};     ///< End of exposure → stamp; nothing when the stamp marks its start.
    Duration time_shift{0};  ///< Added in the end.
  };

  ExposureClock(Delays delays, std::string driver, bool by_cameras_clock)
      : delays_(delays), driver_(std::move(driver)), by_cameras_clock_(by_cameras_clock) {}

  /// @param now  when the image was taken from the kernel; stands in for a stamp that cannot be
  ///             true (from the future, of another clock)
  [[nodiscard]] Instant middle(const KernelStamp& stamp, Instant now);
  void set_exposure(Duration exposure) { delays_.exposure = exposure; }
  [[nodiscard]] const Delays& delays() const { return delays_; }

  /// Of the last stamp.
  [[nodiscard]] StampMark mark() const { return mark_; }

 private:
  Delays delays_;
  std::string driver_;
  bool by_cameras_clock_;
  StampMark mark_{StampMark::kArrival};
};

}  // namespace fiducap::v4l2
