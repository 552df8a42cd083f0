#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <variant>

#include <Eigen/Core>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "capture/import/message_log.hpp"
#include "capture/ros_image.hpp"

namespace fiducap {

/// Reads the fields of a message of ROS in order. ROS 1 packs them; CDR aligns each number to its
/// size and begins with its byte order. Never past the end.
class RosFields final {
 public:
  /// @return Error for an unknown format or kind of CDR
  [[nodiscard]] static Expected<RosFields> open(MessageFormat format,
                                                std::span<const std::byte> message);

  std::uint8_t u8() {
    return std::visit([](auto& from) { return from.u8(); }, from_);
  }
  std::uint32_t u32() {
    align(4);
    return std::visit([](auto& from) { return from.u32(); }, from_);
  }
  double f64() {
    align(8);
    return std::visit([](auto& from) { return from.f64(); }, from_);
  }
  void skip_f64s(std::size_t n) {
    if (n == 0) return;
    align(8);
    raw(8 * n);
  }
  std::string_view text() {
    std::string_view text = text_of_bytes(raw(count(1)));
    if (aligned_ && text.ends_with('\0')) text.remove_suffix(1);
    return text;
  }
  /// The bytes of a sequence of uint8.
  std::span<const std::uint8_t> bytes() {
    const auto all = raw(count(1));
    return {reinterpret_cast<const std::uint8_t*>(all.data()), all.size()};
  }
  /// Number of entries of a sequence. Fails when fewer bytes are left than that many entries need.
  std::size_t count(std::size_t entry_bytes) {
    const std::size_t n = u32();
    const std::size_t left = std::visit([](const auto& from) { return from.left(); }, from_);
    if (n * entry_bytes <= left) return n;
    raw(std::numeric_limits<std::size_t>::max());  // sets the failure
    return 0;
  }
  /// Of a Header: nanoseconds since 1970; skips its frame id.
  std::int64_t header_stamp_ns();

  [[nodiscard]] Expected<void> check(const char* what) const {
    return std::visit([what](const auto& from) { return from.check(what); }, from_);
  }

 private:
  RosFields(std::variant<LittleEndianReader, BigEndianReader> from, bool aligned, std::size_t size)
      : from_(std::move(from)), aligned_(aligned), size_(size) {}
  void align(std::size_t to) {
    if (!aligned_) return;
    const std::size_t at = size_ - std::visit([](const auto& from) { return from.left(); }, from_);
    const std::size_t fill = (to - at % to) % to;
    if (fill > 0) raw(fill);
  }
  std::span<const std::byte> raw(std::size_t n) {
    return std::visit([n](auto& from) { return from.bytes(n); }, from_);
  }

  std::variant<LittleEndianReader, BigEndianReader> from_;
  bool aligned_;
  std::size_t size_;
};

namespace ros {

// The imported messages of a log; they point into the message's bytes.
struct ImuMessage {
  std::int64_t stamp_ns{};
  Eigen::Vector3d w{Eigen::Vector3d::Zero()};
  Eigen::Vector3d f{Eigen::Vector3d::Zero()};
};

/// Of a CompressedImage the size is 0, and `encoding` e.g. `bgr8; jpeg compressed bgr8`.
struct ImageMessage {
  std::int64_t stamp_ns{};
  RawImage image;
};

[[nodiscard]] Expected<ImuMessage> read_imu(MessageFormat format, std::span<const std::byte> in);
[[nodiscard]] Expected<ImageMessage> read_image(MessageFormat format,
                                                std::span<const std::byte> in);
[[nodiscard]] Expected<ImageMessage> read_compressed(MessageFormat format,
                                                     std::span<const std::byte> in);
/// The lens in a sensor_msgs/CameraInfo, if its model is supported.
[[nodiscard]] Expected<CameraModel> read_lens(MessageFormat format, std::span<const std::byte> in,
                                              bool of_rectified = false);

}  // namespace ros

}  // namespace fiducap
