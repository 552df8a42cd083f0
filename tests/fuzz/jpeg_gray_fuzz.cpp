// An image of a USB camera: whatever arrives over the cable and says that it is a JPEG.
#include "capture/v4l2/pixel_format.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  static v4l2::JpegGray reader;
  static GrayImage image;
  image.resize(16, 16);
  (void)reader.read(std::as_bytes(std::span(data, size)), image);
  fuzz::require(image.width == 16 && image.height == 16 && image.pixels.size() == 256);
  return 0;
}
