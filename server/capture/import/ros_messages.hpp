#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "base/expected.hpp"
#include "capture/import/message_log.hpp"
#include "capture/imu_sample.hpp"
#include "capture/ros_image.hpp"

/// The messages of a log that become a recording. What they point to are the message's bytes.
namespace fiducap::ros {

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
  std::string_view format;  ///< What the sender says of it, e.g. `bgr8; jpeg compressed bgr8`.
  std::span<const std::uint8_t> data;
};

[[nodiscard]] Expected<ImuMessage> read_imu(MessageFormat format, std::span<const std::byte> in);
[[nodiscard]] Expected<ImageMessage> read_image(MessageFormat format,
                                                std::span<const std::byte> in);
[[nodiscard]] Expected<CompressedMessage> read_compressed(MessageFormat format,
                                                          std::span<const std::byte> in);
/// The lens that a sensor_msgs/CameraInfo tells, if it is one that we have.
[[nodiscard]] Expected<CameraModel> read_lens(MessageFormat format, std::span<const std::byte> in,
                                              bool of_rectified = false);

}  // namespace fiducap::ros
