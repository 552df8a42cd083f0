#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "base/expected.hpp"
#include "capture/gray_image.hpp"

namespace fiducap::v4l2 {

/// Reads the gray of JPEG images of a camera. Colours are not even decoded. One for each thread.
///
/// An image whose end is missing, or whose data is damaged, is an error: libjpeg would paint the
/// rest of it gray.
class JpegGray final {
 public:
  JpegGray();
  ~JpegGray();
  JpegGray(const JpegGray&) = delete;
  JpegGray& operator=(const JpegGray&) = delete;

  /// @param bytes  an image and perhaps something behind it
  /// @param out    its size is the size wanted, and that of the image if it is read
  [[nodiscard]] Expected<void> read(std::span<const std::byte> bytes, GrayImage& out);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap::v4l2
