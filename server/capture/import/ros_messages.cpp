#include "capture/import/ros_messages.hpp"

namespace fiducap {

Expected<RosFields> RosFields::open(MessageFormat format, std::span<const std::byte> message) {
  if (format == MessageFormat::kRos1)
    return RosFields(LittleEndianReader(message), false, message.size());
  if (format != MessageFormat::kCdr)
    return fail(ErrorCode::kUnsupported, "is neither serialised by ROS 1 nor as CDR");
  constexpr std::size_t kEncapsulation = 4;
  if (message.size() < kEncapsulation)
    return fail(ErrorCode::kTruncated, "is shorter than the head of CDR");
  const auto kind =
      std::to_integer<unsigned>(message[0]) * 256 + std::to_integer<unsigned>(message[1]);
  const auto body = message.subspan(kEncapsulation);
  if (kind == 0) return RosFields(BigEndianReader(body), true, body.size());
  if (kind == 1) return RosFields(LittleEndianReader(body), true, body.size());
  return fail(ErrorCode::kUnsupported,
              "is CDR of representation " + std::to_string(kind) + "; supported are 0 and 1");
}

std::int64_t RosFields::header_stamp_ns() {
  if (!aligned_) u32();  // sequence number of ROS 1
  const std::uint32_t sec = u32();
  const std::uint32_t nanosec = u32();
  text();
  // Signed in ROS 2, unsigned in ROS 1.
  const std::int64_t s = aligned_ ? std::int64_t{static_cast<std::int32_t>(sec)} : sec;
  return s * 1'000'000'000 + nanosec;
}

}  // namespace fiducap

namespace fiducap::ros {
namespace {

constexpr std::size_t kCovariance = 9;

Eigen::Vector3d vector_of(RosFields& from) {
  const double x = from.f64();
  const double y = from.f64();
  const double z = from.f64();
  return {x, y, z};
}

/// @param take  reads the fields after the header
template <typename Message, typename Take>
Expected<Message> read_message(MessageFormat format, std::span<const std::byte> in,
                               const char* type, Take&& take) {
  auto from = RosFields::open(format, in);
  if (!from) return tl::unexpected(from.error());
  Message message;
  message.stamp_ns = from->header_stamp_ns();
  take(*from, message);
  return from->check(type).map([&] { return std::move(message); });
}

}  // namespace

Expected<ImuMessage> read_imu(MessageFormat format, std::span<const std::byte> in) {
  return read_message<ImuMessage>(format, in, "sensor_msgs/Imu", [](RosFields& from, auto& imu) {
    from.skip_f64s(4 + kCovariance);  // orientation
    imu.w = vector_of(from);
    from.skip_f64s(kCovariance);
    imu.f = vector_of(from);
    from.skip_f64s(kCovariance);
  });
}

Expected<ImageMessage> read_image(MessageFormat format, std::span<const std::byte> in) {
  const auto take = [](RosFields& from, ImageMessage& message) {
    message.image.height = from.u32();
    message.image.width = from.u32();
    message.image.encoding = from.text();
    message.image.is_bigendian = from.u8() != 0;
    message.image.step = from.u32();
    message.image.data = from.bytes();
  };
  return read_message<ImageMessage>(format, in, "sensor_msgs/Image", take);
}

Expected<ImageMessage> read_compressed(MessageFormat format, std::span<const std::byte> in) {
  const auto take = [](RosFields& from, ImageMessage& message) {
    message.image.encoding = from.text();
    message.image.data = from.bytes();
  };
  return read_message<ImageMessage>(format, in, "sensor_msgs/CompressedImage", take);
}

Expected<CameraModel> read_lens(MessageFormat format, std::span<const std::byte> in,
                                bool of_rectified) {
  auto from = RosFields::open(format, in);
  if (!from) return tl::unexpected(from.error());
  CameraInfo info;
  (void)from->header_stamp_ns();
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
