#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "base/time.hpp"

namespace fiducap {

/// Whether what comes over a link is the protocol that was configured, in words and once, with the
/// likely cause. What is behind it fails in few ways: nothing is connected, the baud rate is wrong,
/// something else speaks, the line is disturbed.
class LinkWatch final {
 public:
  /// @param unit  what the protocol is made of: `line of the IMU protocol`, `MAVLink frame`
  LinkWatch(std::string unit, bool is_serial, int baud)
      : unit_(std::move(unit)), is_serial_(is_serial), baud_(baud) {}

  /// What came, maybe nothing, and what was in it. @param broken  units with a wrong checksum
  void add(std::size_t bytes, std::size_t printable, std::uint64_t units, std::uint64_t broken,
           Instant now);
  /// What is to be said since the last call.
  [[nodiscard]] std::optional<std::string> take_news() {
    return std::exchange(news_, std::nullopt);
  }

 private:
  void say_what_it_looks_like();
  void say(std::string text);

  std::string unit_;
  bool is_serial_;
  int baud_;
  std::optional<Instant> heard_at_;  ///< Newest byte, or the beginning.
  std::size_t bytes_{0};             ///< Since the last unit.
  std::size_t printable_{0};
  std::uint64_t broken_{0};
  std::uint64_t units_{0};  ///< Of the present window, to judge how many are broken.
  std::uint64_t broken_in_window_{0};
  bool told_silent_{false};
  bool told_foreign_{false};
  bool told_broken_{false};
  std::optional<std::string> news_;
};

/// Bytes of a text.
[[nodiscard]] bool is_printable(std::byte byte);

}  // namespace fiducap
