#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <variant>

#include "capture/imu_sample.hpp"
#include "capture/stamp_mapper.hpp"

namespace fiducap {

/// `IMU,<microseconds>,<gx>,<gy>,<gz>,<ax>,<ay>,<az>*<checksum>`
struct ImuLine {
  std::uint64_t count_us{};
  Eigen::Vector3d w{Eigen::Vector3d::Zero()};
  Eigen::Vector3d f{Eigen::Vector3d::Zero()};
};

/// `TRG,<microseconds>,<count>*<checksum>`: a camera was triggered.
struct TriggerLine {
  std::uint64_t count_us{};
  std::uint64_t number{};
};

enum class LineFault { kChecksum, kForm };

/// One line without its end. See docs/imu-line-protocol.md.
[[nodiscard]] std::variant<ImuLine, TriggerLine, LineFault> parse_line(std::string_view line);

/// Decodes the bytes of a device with the line protocol to samples. No socket, no clock.
class LineReceiver final {
 public:
  struct Counts {
    std::uint64_t readings{0};
    std::uint64_t triggers{0};
    std::uint64_t wrong_checksums{0};
    std::uint64_t malformed{0};  ///< Also lines that are too long.
    std::uint64_t comments{0};   ///< Lines that begin with `#`.
  };
  /// The newest camera trigger, on our time line.
  struct Trigger {
    Instant at{};
    std::uint64_t number{};
  };

  void receive(std::span<const std::byte> bytes, Instant arrived);
  [[nodiscard]] std::optional<ImuSample> take() { return waiting_.take(); }
  /// Another sender follows: discards the incomplete line.
  void restart() { length_ = kUnknown; }

  [[nodiscard]] const Counts& counts() const { return counts_; }
  [[nodiscard]] const DeviceClock& clock() const { return clock_; }
  [[nodiscard]] const std::optional<Trigger>& trigger() const { return trigger_; }

 private:
  static constexpr std::size_t kLongest = 192;
  static constexpr std::size_t kUnknown = kLongest + 1;  ///< In the middle of a line.
  void end_line(Instant arrived);

  std::array<char, kLongest> line_{};
  std::size_t length_{kUnknown};  ///< A half line at the beginning is no fault.
  DeviceClock clock_{32, 1000};
  ImuQueue waiting_;
  std::optional<Trigger> trigger_;
  Counts counts_;
};

}  // namespace fiducap
