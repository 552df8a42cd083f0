#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/handover.hpp"

namespace fiducap {

struct PixelSize {
  int width{};
  int height{};
  bool operator==(const PixelSize&) const = default;
};

/// `640 x 480`
[[nodiscard]] std::string size_text(std::int64_t width, std::int64_t height);
[[nodiscard]] inline std::string size_text(PixelSize size) {
  return size_text(size.width, size.height);
}

/// 8-bit gray pixels, rows packed. Pixel (0, 0) is the upper-left one; u grows right, v grows down.
struct GrayImage {
  int width{};
  int height{};
  std::vector<std::uint8_t> pixels;  ///< height × width

  /// Sets the size, keeps the memory.
  void resize(int w, int h) {
    width = w;
    height = h;
    pixels.resize(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
  }
};

using GrayImagePool = ObjectPool<GrayImage>;

/// Size in the header of a JPEG or PNG, for a check before decoding: it may claim gigabytes.
[[nodiscard]] Expected<PixelSize> encoded_size(std::span<const std::byte> image);

/// Averages an image to a width of `width` pixels; copies one that is not wider.
/// Single-threaded: OpenCV would use threads of normal priority for a caller of low priority.
/// @param sums  kept for its memory
void scale_down(const GrayImage& image, int width, GrayImage& out, std::vector<float>& sums);

/// @param bytes  replaced; empty when the image cannot be encoded
void encode_jpeg(const GrayImage& image, std::vector<std::uint8_t>& bytes);

/// Reads PNG, JPEG or another image file that OpenCV knows into `out`.
/// @param out      its size is the size wanted; another size in the file is an error
/// @param scratch  holds the file; kept by the caller so that its memory is reused
[[nodiscard]] Expected<void> read_gray_file(const std::filesystem::path& file,
                                            std::vector<std::uint8_t>& scratch, GrayImage& out);

/// The same for a camera without calibration: `out` gets the size of the file.
[[nodiscard]] Expected<void> read_gray_file_of_any_size(const std::filesystem::path& file,
                                                        std::vector<std::uint8_t>& scratch,
                                                        GrayImage& out);

/// Writes a PNG, lossless and quickly rather than small.
/// @return its size in bytes
[[nodiscard]] Expected<std::uint64_t> write_gray_file(const std::filesystem::path& file,
                                                      std::vector<std::uint8_t>& scratch,
                                                      const GrayImage& image);

}  // namespace fiducap
