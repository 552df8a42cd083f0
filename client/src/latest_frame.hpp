#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <utility>

#include "fiducap/client.hpp"

namespace fiducap::sdk {

/// The newest frame for one writer and any number of readers, without waiting.
///
/// One word has the slot of the newest frame and the number of its readers, so that one `fetch_add`
/// both finds the frame and protects it from the writer: readers are wait-free. The writer fills a
/// slot without readers. It skips a frame when all seven other slots are being copied.
class LatestFrame {
 public:
  /// Writer only. Swaps `frame` with an old one, whose memory is reused.
  /// @return the published frame, valid until the next call; nullptr when no slot was free (`frame`
  /// is unchanged)
  const Frame* publish(Frame& frame) {
    const std::uint64_t current = current_.load(std::memory_order_relaxed) >> kIndexShift;
    for (std::uint64_t i = 0; i < kPlaces; ++i) {
      Place& place = places_[i];
      if (i == current || place.taken != place.left.load(std::memory_order_acquire)) continue;
      std::swap(place.frame, frame);
      place.filled = true;
      const std::uint64_t before = current_.exchange(i << kIndexShift, std::memory_order_acq_rel);
      places_[current].taken += before & kCountMask;
      return &place.frame;
    }
    return nullptr;
  }

  /// Any thread. Calls `use(const Frame&)` with the newest frame. @return false before the first
  /// frame.
  template <typename Use>
  bool read(Use&& use) const {
    const Reading reading(*this);
    if (!reading.place.filled) return false;
    std::forward<Use>(use)(std::as_const(reading.place.frame));
    return true;
  }

 private:
  static constexpr std::uint64_t kPlaces = 8;
  static constexpr int kIndexShift = 56;  // fewer than 2^56 reads between two frames
  static constexpr std::uint64_t kCountMask = (std::uint64_t{1} << kIndexShift) - 1;

  struct alignas(64) Place {
    Frame frame;
    bool filled{false};
    std::uint64_t taken{0};              // by readers while this was the newest; writer only
    std::atomic<std::uint64_t> left{0};  // by readers that are done
  };

  struct Reading {
    explicit Reading(const LatestFrame& latest)
        : place(latest.places_[latest.current_.fetch_add(1, std::memory_order_acq_rel) >>
                               kIndexShift]) {}
    ~Reading() { place.left.fetch_add(1, std::memory_order_release); }
    Reading(const Reading&) = delete;
    Reading& operator=(const Reading&) = delete;
    Place& place;
  };

  mutable std::array<Place, kPlaces> places_;
  alignas(64) mutable std::atomic<std::uint64_t> current_{0};
};

}  // namespace fiducap::sdk
