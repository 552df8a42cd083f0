#include "daemon/system_clock.hpp"

#include <ctime>
#include <mutex>

namespace fiducap {

namespace {

std::int64_t read_ns(clockid_t id) {
  timespec t{};
  clock_gettime(id, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

}  // namespace

Instant SystemClock::now() const { return instant_from_ns(read_ns(CLOCK_MONOTONIC)); }

bool SystemClock::wait_until(Instant at, std::stop_token stop) const {
  // libstdc++'s steady_clock is CLOCK_MONOTONIC, so the numbers are the same.
  const std::chrono::steady_clock::time_point until{at.time_since_epoch()};
  std::mutex mine;
  std::unique_lock lock(mine);
  never_.wait_until(lock, stop, until, [] { return false; });
  return !stop.stop_requested();
}

Duration utc_offset() {
  const std::int64_t before = read_ns(CLOCK_MONOTONIC);
  const std::int64_t utc = read_ns(CLOCK_REALTIME);
  const std::int64_t after = read_ns(CLOCK_MONOTONIC);
  return Duration{utc - before - (after - before) / 2};
}

std::int64_t utc_now_ns() { return read_ns(CLOCK_REALTIME); }

}  // namespace fiducap
