#include "capture/v4l2/exposure_clock.hpp"

namespace fiducap::v4l2 {
namespace {

// A buffer waits no longer than that, even behind a busy reader. Drivers that compute the end of a
// frame say it before it is there, by less than a frame; other clocks are off by days.
constexpr Duration kLongestWait = std::chrono::seconds(5);
constexpr Duration kFuture = std::chrono::milliseconds(200);

bool may_be_true(const KernelStamp& stamp, Instant now) {
  const Duration age = now - instant_from_ns(stamp.ns);
  return stamp.is_monotonic && age >= -kFuture && age <= kLongestWait;
}

}  // namespace

StampMark mark_of(const KernelStamp& stamp, const std::string& driver, bool by_cameras_clock) {
  if (!stamp.is_monotonic) return StampMark::kArrival;
  if (!stamp.marks_start) return StampMark::kEndOfFrame;
  return driver == "uvcvideo" && !by_cameras_clock ? StampMark::kFirstBytes
                                                   : StampMark::kStartOfExposure;
}

std::string words_for(StampMark mark) {
  switch (mark) {
    case StampMark::kStartOfExposure:
      return "the kernel's, at the start of the exposure";
    case StampMark::kFirstBytes:
      return "the kernel's, when an image begins to arrive";
    case StampMark::kEndOfFrame:
      return "the kernel's, when an image has arrived";
    case StampMark::kArrival:
      break;
  }
  return "of when we are given an image, later by some milliseconds each time: the driver's are "
         "of another clock";
}

Instant ExposureClock::middle(const KernelStamp& stamp, Instant now) {
  mark_ =
      may_be_true(stamp, now) ? mark_of(stamp, driver_, by_cameras_clock_) : StampMark::kArrival;
  const Instant marked = mark_ == StampMark::kArrival ? now : instant_from_ns(stamp.ns);
  const Duration half = delays_.exposure / 2;
  const Instant middle =
      mark_ == StampMark::kStartOfExposure ? marked + half : marked - delays_.latency - half;
  return middle + delays_.time_shift;
}

}  // namespace fiducap::v4l2
