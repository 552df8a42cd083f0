// Images and calibrations of cameras.
#include <cmath>
#include <iterator>
#include <string_view>

#include "base/bytes.hpp"
#include "capture/gray_image.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/ros_image.hpp"
#include "capture/v4l2/pixel_format.hpp"
#include "fuzz/memory_file.hpp"

// Calibrations of other programs. The first byte chooses: one camera, several, Kalibr's IMU.
FUZZ(calibration_fuzz, input) {
  static const MemoryFile file;
  const unsigned which = input.choose(3);
  file.put(input.bytes);
  if (which == 0) {
    if (const auto camera = read_camera_calibration(file.path())) require(camera->check().empty());
  } else if (which == 1) {
    const auto cameras = read_calibration(file.path(), {});
    require(!cameras || !cameras->empty());
    for (const CalibratedCamera& camera : cameras.value_or(std::vector<CalibratedCamera>{}))
      require(camera.mount.model.check().empty());
  } else if (const auto imu = read_imu_noise(file.path())) {
    require(std::isfinite(imu->gyro_noise_rad_s_rtHz));
  }
}

// An image of a recording, a calibration or a message: any file that OpenCV may accept.
FUZZ(gray_file_fuzz, input) {
  static const MemoryFile file;
  file.put(input.bytes);
  GrayDecoder decoder;
  GrayImage image;
  (void)decoder.read_file(file.path(), PixelSize{8, 6}, image);
  (void)decoder.decode(
      {reinterpret_cast<const std::uint8_t*>(input.bytes.data()), input.bytes.size()}, {}, image);
  if (!decoder.read_file(file.path(), {}, image)) return;
  require(image.width > 0 && image.height > 0);
  require(image.pixels.size() ==
          static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
}

// An image of a USB camera that should be a JPEG.
FUZZ(jpeg_gray_fuzz, input) {
  static v4l2::JpegGray reader;
  static GrayImage image;
  image.resize(16, 16);
  (void)reader.read(input.bytes, image);
  require(image.width == 16 && image.height == 16 && image.pixels.size() == 256);
}

// sensor_msgs/Image and CompressedImage. The first bytes choose size, step and encoding.
FUZZ(ros_image_fuzz, input) {
  (void)encoded_size(input.bytes);
  LittleEndianReader from(input.bytes);
  CameraModel camera;
  camera.width = 1 + from.u8() % 64;
  camera.height = 1 + from.u8() % 64;
  constexpr std::string_view kEncodings[] = {
      "mono8", "mono16",      "bgr8",        "rgb8",  "bgra8", "yuv422", "yuyv",
      "8UC3",  "bayer_rggb8", "bayer_gbrg8", "32FC1", "",      "bgra16", "nv21"};
  ros::RawImage image;
  image.encoding = kEncodings[from.u8() % std::size(kEncodings)];
  const std::uint8_t wrong = from.u8();
  image.width = (wrong & 1) != 0 ? from.u32() : static_cast<std::uint32_t>(camera.width);
  image.height = (wrong & 2) != 0 ? from.u32() : static_cast<std::uint32_t>(camera.height);
  image.step = (wrong & 4) != 0 ? from.u32() : from.u8() + image.width * 4u;
  image.is_bigendian = (wrong & 8) != 0;
  const auto rest = from.bytes(from.left());
  image.data = {reinterpret_cast<const std::uint8_t*>(rest.data()), rest.size()};
  GrayImage gray;
  const auto converted = ros::GrayConversion().convert(image, camera, gray);
  require(!converted ||
          gray.pixels.size() == static_cast<std::size_t>(camera.width * camera.height));
}
