#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace fiducap::fan_out {

struct Load {
  int bodies{100};
  double rate_hz{200};
  double seconds{10};
};

/// Shared by server and clients, two processes.
struct Shared {
  enum Protocol { kNative, kVrpn, kNatNet, kVicon, kQualisys, kProtocols };
  std::array<std::atomic<std::uint16_t>, kProtocols> ports{};
  std::atomic<bool> ready{false};
  std::atomic<bool> go{false};  ///< The clients are connected: frames may come.
  std::atomic<bool> failed{false};
  /// Frame n is for this + (n − 1) periods, CLOCK_MONOTONIC.
  std::atomic<std::int64_t> first_at_ns{0};
  std::atomic<std::int64_t> utc_offset_ns{0};
  std::atomic<std::uint64_t> frames{0};
  std::atomic<double> cpu_share{0};  ///< Of one core, while frames flowed.
  std::atomic<std::int64_t> memory_grown_kB{0};
};

/// All protocol servers behind a scene of bodies that move without sensors, in a process of its
/// own.
/// @return exit code
int run_stage(const Load& load, Shared& shared);

}  // namespace fiducap::fan_out
