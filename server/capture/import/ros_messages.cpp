#include "capture/import/ros_messages.hpp"

#include <algorithm>

#include "capture/import/ros_fields.hpp"

namespace fiducap::ros {
namespace {

constexpr std::size_t kCovariance = 9;

Eigen::Vector3d vector_of(RosFields& from) {
  const double x = from.f64();
  const double y = from.f64();
  const double z = from.f64();
  return {x, y, z};
}

}  // namespace

Expected<ImuMessage> read_imu(MessageFormat format, std::span<const std::byte> in) {
  auto from = RosFields::open(format, in);
  if (!from) return tl::unexpected(from.error());
  ImuMessage imu;
  imu.stamp_ns = from->header_stamp_ns();
  from->skip_f64s(4 + kCovariance);  // orientation
  imu.w = vector_of(*from);
  from->skip_f64s(kCovariance);
  imu.f = vector_of(*from);
  from->skip_f64s(kCovariance);
  if (const auto whole = from->check("sensor_msgs/Imu"); !whole)
    return tl::unexpected(whole.error());
  return imu;
}

Expected<ImageMessage> read_image(MessageFormat format, std::span<const std::byte> in) {
  auto from = RosFields::open(format, in);
  if (!from) return tl::unexpected(from.error());
  ImageMessage message;
  message.stamp_ns = from->header_stamp_ns();
  message.image.height = from->u32();
  message.image.width = from->u32();
  message.image.encoding = from->text();
  message.image.is_bigendian = from->u8() != 0;
  message.image.step = from->u32();
  message.image.data = from->bytes();
  if (const auto whole = from->check("sensor_msgs/Image"); !whole)
    return tl::unexpected(whole.error());
  return message;
}

Expected<CompressedMessage> read_compressed(MessageFormat format, std::span<const std::byte> in) {
  auto from = RosFields::open(format, in);
  if (!from) return tl::unexpected(from.error());
  CompressedMessage message;
  message.stamp_ns = from->header_stamp_ns();
  message.format = from->text();
  message.data = from->bytes();
  if (const auto whole = from->check("sensor_msgs/CompressedImage"); !whole)
    return tl::unexpected(whole.error());
  return message;
}

Expected<CameraModel> read_lens(MessageFormat format, std::span<const std::byte> in,
                                bool of_rectified) {
  auto from = RosFields::open(format, in);
  if (!from) return tl::unexpected(from.error());
  CameraInfo info;
  [[maybe_unused]] const std::int64_t stamp_ns = from->header_stamp_ns();
  info.height = from->u32();
  info.width = from->u32();
  info.distortion_model = from->text();
  std::vector<double> coefficients(from->count(8));
  for (double& k : coefficients) k = from->f64();
  info.coefficients = coefficients;
  for (double& k : info.K) k = from->f64();
  from->skip_f64s(9);  // R: how rectified images are turned
  for (double& k : info.P) k = from->f64();
  info.binning_x = from->u32();
  info.binning_y = from->u32();
  info.roi_x = from->u32();
  info.roi_y = from->u32();
  if (const auto whole = from->check("sensor_msgs/CameraInfo"); !whole)
    return tl::unexpected(whole.error());
  return camera_model(info, of_rectified);
}

}  // namespace fiducap::ros
