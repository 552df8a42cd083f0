#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "base/time.hpp"
#include "capture/jump_gate.hpp"

namespace fiducap {

/// How alive a body's samples are: written by its threads, read by whoever watches over them.
/// Server time; 0: none came yet.
struct BodyPulse {
  std::atomic<std::int64_t> image_came_ns{0};
  std::array<std::atomic<std::int64_t>, kMostCameras> camera_came_ns{};  ///< The same, each.
  std::atomic<std::int64_t> imu_came_ns{0};
  std::atomic<std::int64_t> lateness_ns{0};  ///< Of the last image: middle of exposure → corrected.
  std::atomic<std::int64_t> on_the_way_ns{0};  ///< … middle of exposure → arrived here.
  std::atomic<std::uint64_t> images{0};        ///< That came.
  std::atomic<std::uint64_t> skipped{0};       ///< Of those: never looked at, for lack of time.
  std::atomic<bool> ended{false};              ///< Nothing more will come.
};

}  // namespace fiducap
