// An image of a recording or a calibration: any file that OpenCV may take for one.
#include "capture/gray_image.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  static const fuzz::MemoryFile file;
  static std::vector<std::uint8_t> scratch;
  file.put(std::as_bytes(std::span(data, size)));
  GrayImage image;
  image.resize(8, 6);
  (void)read_gray_file(file.path(), scratch, image);
  if (read_gray_file_of_any_size(file.path(), scratch, image)) {
    fuzz::require(image.width > 0 && image.height > 0);
    fuzz::require(image.pixels.size() ==
                  static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  }
  return 0;
}
