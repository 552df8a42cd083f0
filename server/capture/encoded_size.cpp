#include "capture/encoded_size.hpp"

#include <algorithm>
#include <array>

#include "base/byte_reader.hpp"

namespace fiducap {

namespace {

constexpr std::array<std::uint8_t, 8> kPng{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

bool begins_with(std::span<const std::byte> image, std::span<const std::uint8_t> magic) {
  return image.size() >= magic.size() &&
         std::equal(magic.begin(), magic.end(), image.begin(),
                    [](std::uint8_t a, std::byte b) { return std::byte{a} == b; });
}

Expected<PixelSize> png_size(std::span<const std::byte> image) {
  BigEndianReader from(image.subspan(kPng.size()));
  from.u32();  // length of the first chunk
  const std::uint32_t type = from.u32();
  const std::uint32_t width = from.u32();
  const std::uint32_t height = from.u32();
  if (auto whole = from.check("PNG header"); !whole) return tl::unexpected(whole.error());
  constexpr std::uint32_t kHeaderChunk = 0x49484452;  // IHDR
  constexpr std::uint32_t kLargest = 0x7fffffff;
  if (type != kHeaderChunk || width > kLargest || height > kLargest) {
    return fail(ErrorCode::kInvalid, "does not begin with a PNG header");
  }
  return PixelSize{static_cast<int>(width), static_cast<int>(height)};
}

bool is_frame_start(std::uint8_t marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

bool stands_alone(std::uint8_t marker) {
  return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8);
}

Expected<PixelSize> jpeg_size(std::span<const std::byte> image) {
  BigEndianReader from(image.subspan(2));
  while (!from.failed() && from.left() > 0) {
    if (from.u8() != 0xff) break;
    std::uint8_t marker = from.u8();
    while (marker == 0xff && from.left() > 0) marker = from.u8();  // fill
    if (stands_alone(marker)) continue;
    if (marker == 0xd9 || marker == 0xda) break;  // end, or pixels before any size
    const std::uint16_t length = from.u16();
    if (from.failed() || length < 2) break;
    if (!is_frame_start(marker)) {
      from.bytes(length - 2u);
      continue;
    }
    from.u8();  // bits
    const int height = from.u16();
    const int width = from.u16();
    if (from.failed()) break;
    return PixelSize{width, height};
  }
  if (auto whole = from.check("JPEG header"); !whole) return tl::unexpected(whole.error());
  return fail(ErrorCode::kInvalid, "has no JPEG size before its pixels");
}

}  // namespace

Expected<PixelSize> encoded_size(std::span<const std::byte> image) {
  if (begins_with(image, kPng)) return png_size(image);
  constexpr std::array<std::uint8_t, 2> kJpeg{0xff, 0xd8};
  if (begins_with(image, kJpeg)) return jpeg_size(image);
  return fail(ErrorCode::kUnsupported, "is neither JPEG nor PNG");
}

}  // namespace fiducap
