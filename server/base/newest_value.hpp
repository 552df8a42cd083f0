#pragma once

#include <array>
#include <atomic>

namespace fiducap {

/// Hands the newest value from one thread to another; neither ever waits. A value that was not
/// fetched in time is replaced.
///
/// Three places: each thread has one of its own, and changes it for the third, which is on offer.
/// Values are written and read in their places, so they keep their memory, and what a place holds
/// is let go of by the writer: a reader of low priority is never the last owner of anything.
template <typename T>
class NewestValue final {
 public:
  /// The writer's place; holds an older value.
  [[nodiscard]] T& writing() { return places_[writing_]; }
  /// Puts what was written on offer. The writer's place is another one from here on.
  void offer() {
    writing_ = offered_.exchange(writing_ | kFresh, std::memory_order_acq_rel) & kPlace;
  }

  /// @return true: there is something new, in `reading()`
  [[nodiscard]] bool fetch() {
    if ((offered_.load(std::memory_order_acquire) & kFresh) == 0) return false;
    reading_ = offered_.exchange(reading_, std::memory_order_acq_rel) & kPlace;
    return true;
  }
  /// The reader's place, until it fetches again.
  [[nodiscard]] T& reading() { return places_[reading_]; }

 private:
  static constexpr unsigned kPlace = 3;
  static constexpr unsigned kFresh = 4;  // not fetched yet

  std::array<T, 3> places_{};
  unsigned writing_{0};
  std::atomic<unsigned> offered_{1};
  unsigned reading_{2};
};

}  // namespace fiducap
