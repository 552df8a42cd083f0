#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
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

/// Size in the header of a PNG, JPEG, BMP, PGM (PBM, PPM) or TIFF, for a check before decoding: it
/// may claim gigabytes. Other formats are refused.
[[nodiscard]] Expected<PixelSize> encoded_size(std::span<const std::byte> image);

/// Averages an image to a width of `width` pixels; copies one that is not wider.
/// Single-threaded: OpenCV would use threads of normal priority for a caller of low priority.
/// @param sums  kept for its memory
void scale_down(const GrayImage& image, int width, GrayImage& out, std::vector<float>& sums);

/// @param bytes  replaced; empty when the image cannot be encoded
void encode_jpeg(const GrayImage& image, std::vector<std::uint8_t>& bytes);

/// Bits of 16-bit pixels that all but a thousandth of them need (counters and hot pixels aside).
/// @param widths  number of pixels by std::bit_width
[[nodiscard]] int bits_of(const std::array<std::uint64_t, 17>& widths);

/// Decodes the image files of one camera to gray. Of 16-bit pixels it takes the eight highest bits
/// that any image so far has used: sensors with 10, 12 or 14 bits leave the others zero.
class GrayDecoder final {
 public:
  using Size = std::optional<PixelSize>;

  /// @param bits  used at least
  explicit GrayDecoder(int bits = 8) : bits_(bits) {}
  /// Its size is checked before decoding (encoded_size).
  /// @param wanted  another size is an error; nullopt: any
  [[nodiscard]] Expected<void> decode(std::span<const std::uint8_t> encoded, Size wanted,
                                      GrayImage& out);
  /// The same of a file.
  [[nodiscard]] Expected<void> read_file(const std::filesystem::path& file, Size wanted,
                                         GrayImage& out);
  /// 8 to 16.
  [[nodiscard]] int used_bits() const { return bits_; }
  /// An image so far had 16-bit pixels.
  [[nodiscard]] bool saw_16_bits() const { return saw_16_bits_; }

 private:
  [[nodiscard]] Expected<void> decode_any(std::span<const std::uint8_t> encoded, Size wanted,
                                          GrayImage& out);

  int bits_;
  bool saw_16_bits_{false};
  std::vector<std::uint8_t> file_;
};

/// Writes a PNG, lossless and quickly rather than small.
/// @return its size in bytes
[[nodiscard]] Expected<std::uint64_t> write_gray_file(const std::filesystem::path& file,
                                                      std::vector<std::uint8_t>& scratch,
                                                      const GrayImage& image);

}  // namespace fiducap
