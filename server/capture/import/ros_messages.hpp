#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <variant>

#include <Eigen/Core>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "capture/import/message_log.hpp"
#include "capture/ros_image.hpp"

namespace fiducap {

/// Reads the fields of one message of ROS in order. ROS 1 packs them; CDR aligns each number to its
/// size and begins with its byte order. Never reads past the end, see ByteReader.
class RosFields final {
 public:
  /// @return Error for an unknown format or kind of CDR
  [[nodiscard]] static Expected<RosFields> open(MessageFormat format,
                                                std::span<const std::byte> message);

  std::uint8_t u8();
  std::uint32_t u32();
  double f64();
  void skip_f64s(std::size_t n);
  std::string_view text();
  /// The bytes of a sequence of uint8.
  std::span<const std::uint8_t> bytes();
  /// Number of entries of a sequence. Fails when fewer bytes are left than that many entries need.
  std::size_t count(std::size_t entry_bytes);
  /// Of a Header: nanoseconds since 1970; skips its frame id.
  std::int64_t header_stamp_ns();

  [[nodiscard]] Expected<void> check(const char* what) const;

 private:
  RosFields(std::variant<LittleEndianReader, BigEndianReader> from, bool aligned, std::size_t size)
      : from_(std::move(from)), aligned_(aligned), size_(size) {}
  void align(std::size_t to);
  std::span<const std::byte> raw(std::size_t n);

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

struct ImageMessage {
  std::int64_t stamp_ns{};
  RawImage image;
};

struct CompressedMessage {
  std::int64_t stamp_ns{};
  std::string_view format;  ///< According to the sender, e.g. `bgr8; jpeg compressed bgr8`.
  std::span<const std::uint8_t> data;
};

[[nodiscard]] Expected<ImuMessage> read_imu(MessageFormat format, std::span<const std::byte> in);
[[nodiscard]] Expected<ImageMessage> read_image(MessageFormat format,
                                                std::span<const std::byte> in);
[[nodiscard]] Expected<CompressedMessage> read_compressed(MessageFormat format,
                                                          std::span<const std::byte> in);
/// The lens in a sensor_msgs/CameraInfo, if its model is supported.
[[nodiscard]] Expected<CameraModel> read_lens(MessageFormat format, std::span<const std::byte> in,
                                              bool of_rectified = false);

}  // namespace ros

}  // namespace fiducap
