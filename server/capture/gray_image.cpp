#include "capture/gray_image.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fstream>
#include <numeric>

#include <opencv2/imgcodecs.hpp>

#include "base/bytes.hpp"
#include "base/text.hpp"
#include "capture/output_file.hpp"

namespace fiducap {
namespace {

constexpr std::string_view kPng = "\x89PNG\r\n\x1a\n";

Expected<PixelSize> png_size(std::span<const std::byte> image) {
  BigEndianReader from(image.subspan(kPng.size()));
  from.u32();  // length of the first chunk
  const std::uint32_t type = from.u32();
  const std::uint32_t width = from.u32();
  const std::uint32_t height = from.u32();
  if (auto whole = from.check("PNG header"); !whole) return tl::unexpected(whole.error());
  constexpr std::uint32_t kHeaderChunk = 0x49484452;  // IHDR
  constexpr std::uint32_t kLargest = 0x7fffffff;
  if (type != kHeaderChunk || width > kLargest || height > kLargest)
    return fail(ErrorCode::kInvalid, "does not begin with a PNG header");
  return PixelSize{static_cast<int>(width), static_cast<int>(height)};
}

Expected<PixelSize> jpeg_size(std::span<const std::byte> image) {
  BigEndianReader from(image.subspan(2));
  while (!from.failed() && from.left() > 0) {
    if (from.u8() != 0xff) break;
    std::uint8_t marker = from.u8();
    while (marker == 0xff && from.left() > 0) marker = from.u8();        // fill
    if (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8)) continue;  // without a length
    if (marker == 0xd9 || marker == 0xda) break;  // end, or pixels before any size
    const std::uint16_t length = from.u16();
    if (from.failed() || length < 2) break;
    const bool is_frame_start =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (!is_frame_start) {
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

Expected<PixelSize> bmp_size(std::span<const std::byte> image) {
  LittleEndianReader from(image.subspan(2));
  from.bytes(12);
  const bool is_short = from.u32() == 12;  // of OS/2
  const auto width = is_short ? from.u16() : static_cast<std::int32_t>(from.u32());
  const auto height = is_short ? from.u16() : static_cast<std::int32_t>(from.u32());
  if (auto whole = from.check("BMP header"); !whole) return tl::unexpected(whole.error());
  if (width < 0 || height == INT32_MIN) return fail(ErrorCode::kInvalid, "has no size in its BMP");
  return PixelSize{width, std::abs(height)};  // negative: the first row is the uppermost one
}

/// PBM, PGM, PPM: `P5`, width, height, with comments between them.
Expected<PixelSize> pnm_size(std::string_view text) {
  text.remove_prefix(2);
  std::array<int, 2> sides{-1, -1};
  for (int& side : sides) {
    for (;;) {
      text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
      if (!text.starts_with('#')) break;
      text.remove_prefix(std::min(text.find('\n'), text.size()));
    }
    const std::string_view digits = text.substr(0, text.find_first_not_of("0123456789"));
    text.remove_prefix(digits.size());
    if (text.empty() || !parse_number(digits, side))
      return fail(ErrorCode::kInvalid, "has no size in its PGM");
  }
  return PixelSize{sides[0], sides[1]};
}

/// Of the first image of a file.
template <typename Reader>
Expected<PixelSize> tiff_size(std::span<const std::byte> image) {
  Reader head(image.subspan(4));
  const std::uint32_t directory = head.u32();
  if (head.failed() || directory > image.size())
    return fail(ErrorCode::kInvalid, "has no directory in its TIFF");
  Reader from(image.subspan(directory));
  PixelSize size{-1, -1};
  for (int left = from.u16(); left > 0 && !from.failed(); --left) {
    constexpr int kWidth = 256, kHeight = 257, kShort = 3;
    const int tag = from.u16();
    const bool is_short = from.u16() == kShort;
    from.u32();  // number of values
    const std::uint32_t value = is_short ? from.u16() : from.u32();
    if (is_short) from.u16();
    if (tag == kWidth || tag == kHeight)
      (tag == kWidth ? size.width : size.height) =
          static_cast<int>(std::min<std::uint32_t>(value, INT32_MAX));
  }
  if (size.width < 0 || size.height < 0)
    return fail(ErrorCode::kInvalid, "has no size in its TIFF");
  return size;
}

/// A progressive JPEG repeats all pixels in each scan. Encoders write up to 14; a file of a few
/// kilobytes with thousands would be decoded for minutes.
constexpr std::ptrdiff_t kMostScans = 100;

bool has_too_many_scans(std::string_view jpeg) {
  constexpr std::string_view kScan = "\xff\xda";
  std::ptrdiff_t scans = 0;
  for (std::size_t at = jpeg.find(kScan); at != std::string_view::npos;
       at = jpeg.find(kScan, at + kScan.size()))
    if (++scans > kMostScans) return true;
  return false;
}

constexpr int kQuality = 80;  // edges of tags stay sharp; a third of the bytes of 95

/// The share of source pixel `i` that lies in [from, to).
float share_of(int i, double from, double to) {
  return static_cast<float>(std::min(i + 1.0, to) - std::max(double(i), from));
}

/// Adds a row of the source, averaged to the width of `sums`.
void add_row(const std::uint8_t* row, int width, float weight, std::vector<float>& sums) {
  const double step = double(width) / static_cast<double>(sums.size());
  for (std::size_t x = 0; x < sums.size(); ++x) {
    const double from = static_cast<double>(x) * step;
    const double to = std::min(double(width), from + step);
    float sum = 0;
    const int first = static_cast<int>(from);
    const int last = std::min(width - 1, static_cast<int>(std::ceil(to)) - 1);
    for (int i = first; i <= last; ++i) sum += share_of(i, from, to) * row[i];
    sums[x] += weight * sum;
  }
}

constexpr std::uintmax_t kMaxImageFile_bytes = 256 << 20;
constexpr std::int64_t kMostPixels = 1 << 27;

Expected<void> read_bytes(const std::filesystem::path& path, std::vector<std::uint8_t>& bytes) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return fail(ErrorCode::kNotFound, "no such image", path.string());
  if (size == 0 || size > kMaxImageFile_bytes)
    return fail(ErrorCode::kInvalid, "is no image: " + std::to_string(size) + " bytes",
                path.string());
  bytes.resize(static_cast<std::size_t>(size));
  std::ifstream file(path, std::ios::binary);
  if (file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size)))
    return {};
  return fail(ErrorCode::kUnavailable, "cannot be read", path.string());
}

/// Before decoding: an image of a few bytes may claim gigabytes.
Expected<void> check_size(const PixelSize& size, const GrayDecoder::Size& wanted) {
  const std::string is = "is " + size_text(size);
  if (wanted && size != *wanted)
    return fail(ErrorCode::kInvalid, is + ", the calibration is for " + size_text(*wanted));
  if (std::int64_t{size.width} * size.height > kMostPixels)
    return fail(ErrorCode::kInvalid, is + ": larger than any camera image");
  return {};
}

}  // namespace

std::string size_text(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

Expected<PixelSize> encoded_size(std::span<const std::byte> image) {
  const std::string_view bytes = text_of_bytes(image);
  if (bytes.starts_with(kPng)) return png_size(image);
  if (bytes.starts_with("\xff\xd8")) {
    if (has_too_many_scans(bytes))
      return fail(ErrorCode::kInvalid,
                  "has more than " + std::to_string(kMostScans) + " scans, which no camera writes");
    return jpeg_size(image);
  }
  if (bytes.starts_with("BM")) return bmp_size(image);
  if (bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6')
    return pnm_size(bytes);
  if (bytes.starts_with(std::string_view("II*\0", 4))) return tiff_size<LittleEndianReader>(image);
  if (bytes.starts_with(std::string_view("MM\0*", 4))) return tiff_size<BigEndianReader>(image);
  return fail(ErrorCode::kUnsupported,
              "is no image in PNG, JPEG, BMP, PGM or TIFF: convert it to one of them");
}

void scale_down(const GrayImage& image, int width, GrayImage& out, std::vector<float>& sums) {
  if (width >= image.width || image.width <= 0 || image.height <= 0) {
    out = image;
    return;
  }
  const double scale = double(image.width) / width;
  const int height = std::max(1, static_cast<int>(std::lround(image.height / scale)));
  out.resize(width, height);
  const double step = double(image.height) / height;
  const auto area = static_cast<float>(scale * step);
  for (int y = 0; y < height; ++y) {
    sums.assign(static_cast<std::size_t>(width), 0.0F);
    const double from = y * step;
    const double to = std::min(double(image.height), from + step);
    const int last = std::min(image.height - 1, static_cast<int>(std::ceil(to)) - 1);
    for (int i = static_cast<int>(from); i <= last; ++i) {
      const std::uint8_t* row =
          image.pixels.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(image.width);
      add_row(row, image.width, share_of(i, from, to), sums);
    }
    std::uint8_t* to_row =
        out.pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    for (std::size_t x = 0; x < sums.size(); ++x)
      to_row[x] = static_cast<std::uint8_t>(std::clamp(sums[x] / area + 0.5F, 0.0F, 255.0F));
  }
}

void encode_jpeg(const GrayImage& image, std::vector<std::uint8_t>& bytes) {
  bytes.clear();
  if (image.width <= 0 || image.height <= 0) return;
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  if (!cv::imencode(".jpg", pixels, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality})) bytes.clear();
}

int bits_of(const std::array<std::uint64_t, 17>& widths) {
  constexpr std::uint64_t kOneOf = 1000;
  const std::uint64_t all = std::accumulate(widths.begin(), widths.end(), std::uint64_t{0});
  std::uint64_t above = 0;
  for (int bits = 16; bits > 8; --bits) {
    above += widths[static_cast<std::size_t>(bits)];
    if (above * kOneOf > all) return bits;
  }
  return 8;
}

Expected<void> GrayDecoder::decode(std::span<const std::uint8_t> encoded, Size wanted,
                                   GrayImage& out) {
  const auto size = encoded_size(std::as_bytes(encoded));
  if (!size) return tl::unexpected(size.error());
  // An image is at most as large as its pixels in 16-bit colour.
  const auto most =
      static_cast<std::size_t>(size->width) * static_cast<std::size_t>(size->height) * 8 + 65536;
  if (encoded.size() > most) return fail(ErrorCode::kInvalid, "is larger than its pixels");
  return decode_any(encoded, wanted, out);
}

Expected<void> GrayDecoder::read_file(const std::filesystem::path& file, Size wanted,
                                      GrayImage& out) {
  if (const auto read = read_bytes(file, file_); !read) return tl::unexpected(read.error());
  auto decoded = decode_any(file_, wanted, out);
  if (!decoded) decoded.error().context = file.string();
  return decoded;
}

/// Ignores the rotation tag of a JPEG: the calibration is for the image as it was read out.
Expected<void> GrayDecoder::decode_any(std::span<const std::uint8_t> encoded, Size wanted,
                                       GrayImage& out) {
  const auto size = encoded_size(std::as_bytes(encoded));
  if (!size) return tl::unexpected(size.error());
  if (const auto fits = check_size(*size, wanted); !fits) return fits;
  // Not decoded into `out`: OpenCV 4.6 leaves it unchanged without an error for broken bytes.
  cv::Mat decoded;
  try {
    const cv::Mat bytes(1, static_cast<int>(encoded.size()), CV_8UC1,
                        const_cast<std::uint8_t*>(encoded.data()));
    decoded = cv::imdecode(
        bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& broken) {
    return fail(ErrorCode::kInvalid, "is no image that can be read: " + broken.err);
  }
  if (decoded.empty() || (decoded.type() != CV_8UC1 && decoded.type() != CV_16UC1))
    return fail(ErrorCode::kInvalid, "is no image that can be read");
  if (const auto fits = check_size({decoded.cols, decoded.rows}, wanted); !fits) return fits;
  out.resize(decoded.cols, decoded.rows);
  if (decoded.type() == CV_8UC1) {
    decoded.copyTo(cv::Mat(out.height, out.width, CV_8UC1, out.pixels.data()));
    return {};
  }
  saw_16_bits_ = true;
  const auto values = cv::Mat_<std::uint16_t>(decoded);
  std::array<std::uint64_t, 17> widths{};
  for (const std::uint16_t value : values)
    ++widths[static_cast<std::size_t>(std::bit_width(value))];
  bits_ = std::max(bits_, bits_of(widths));
  std::transform(values.begin(), values.end(), out.pixels.begin(), [&](std::uint16_t value) {
    return static_cast<std::uint8_t>(std::min(value >> (bits_ - 8), 255));
  });
  return {};
}

Expected<std::uint64_t> write_gray_file(const std::filesystem::path& file,
                                        std::vector<std::uint8_t>& scratch,
                                        const GrayImage& image) {
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  constexpr int kQuickest = 1;
  try {
    cv::imencode(".png", pixels, scratch, {cv::IMWRITE_PNG_COMPRESSION, kQuickest});
  } catch (const cv::Exception& broken) {
    return fail(ErrorCode::kInvalid, "cannot be encoded: " + broken.err, file.string());
  }
  return write_output_file(
      file, std::string_view(reinterpret_cast<const char*>(scratch.data()), scratch.size()));
}

}  // namespace fiducap
