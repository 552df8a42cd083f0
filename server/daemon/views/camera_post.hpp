#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "base/newest_value.hpp"
#include "pipeline/camera_view.hpp"
#include "streaming/camera_views.hpp"

namespace fiducap {

/// One camera between three threads: the body's worker leaves what it saw, the thread of the views
/// makes a picture of it, the pages' thread takes that. Nobody waits for anybody.
class CameraPost final {
 public:
  /// From the pages' thread. @param wish  nullopt: nobody watches
  void watch(const std::optional<ViewWish>& wish) {
    wish_.store(wish ? packed(*wish) : 0, std::memory_order_relaxed);
  }
  /// From any thread. nullopt: nobody watches, and nothing is to be done for it.
  [[nodiscard]] std::optional<ViewWish> wish() const {
    const std::uint64_t word = wish_.load(std::memory_order_relaxed);
    if (word == 0) return std::nullopt;
    return ViewWish{static_cast<int>(word >> 16), static_cast<int>(word >> 2 & 0xff),
                    (word & 2) != 0};
  }

  NewestValue<CameraView> seen;            ///< Worker → views.
  NewestValue<CameraViews::Picture> made;  ///< Views → pages.

 private:
  [[nodiscard]] static std::uint64_t packed(const ViewWish& wish) {
    return static_cast<std::uint64_t>(wish.width_px) << 16 |
           static_cast<std::uint64_t>(wish.per_second) << 2 | (wish.candidates ? 2 : 0) | 1;
  }

  std::atomic<std::uint64_t> wish_{0};
};

/// Wakes a thread that waits, without a lock.
class Doorbell final {
 public:
  void ring() noexcept {
    rung_.fetch_add(1, std::memory_order_release);
    rung_.notify_one();
  }
  /// @param heard  how often it had rung when the caller last looked   @return how often by now
  [[nodiscard]] std::uint32_t wait(std::uint32_t heard) const {
    rung_.wait(heard, std::memory_order_acquire);
    return rung_.load(std::memory_order_acquire);
  }

 private:
  std::atomic<std::uint32_t> rung_{0};
};

}  // namespace fiducap
