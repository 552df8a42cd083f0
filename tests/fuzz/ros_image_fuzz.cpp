// sensor_msgs/Image and CompressedImage as anybody may send them. The first bytes choose size, step
// and encoding.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/bytes.hpp"
#include "capture/gray_image.hpp"
#include "capture/ros_image.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const auto bytes = std::as_bytes(std::span(data, size));
  (void)encoded_size(bytes);

  LittleEndianReader from(bytes);
  CameraModel camera;
  camera.width = 1 + from.u8() % 64;
  camera.height = 1 + from.u8() % 64;
  constexpr std::string_view kEncodings[] = {"mono8",       "mono16",      "bgr8",  "rgb8",
                                             "bgra8",       "yuv422",      "yuyv",  "8UC3",
                                             "bayer_rggb8", "bayer_gbrg8", "32FC1", ""};
  ros::RawImage image;
  image.encoding = kEncodings[from.u8() % std::size(kEncodings)];
  const std::uint8_t lies = from.u8();
  image.width = (lies & 1) != 0 ? from.u32() : static_cast<std::uint32_t>(camera.width);
  image.height = (lies & 2) != 0 ? from.u32() : static_cast<std::uint32_t>(camera.height);
  image.step = (lies & 4) != 0 ? from.u32() : from.u8() + image.width * 4u;
  image.is_bigendian = (lies & 8) != 0;
  const auto rest = from.bytes(from.left());
  image.data = {reinterpret_cast<const std::uint8_t*>(rest.data()), rest.size()};
  GrayImage gray;
  const auto converted = ros::to_gray(image, camera, gray);
  if (converted && gray.pixels.size() != static_cast<std::size_t>(camera.width * camera.height))
    std::abort();
  return 0;
}
