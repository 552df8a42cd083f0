#include "capture/v4l2/pixel_format.hpp"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstring>

#include <jerror.h>
#include <jpeglib.h>
#include <linux/videodev2.h>

namespace fiducap::v4l2 {
namespace {

constexpr std::array kFormats{
    PixelFormat{V4L2_PIX_FMT_GREY, "GREY"},
    PixelFormat{V4L2_PIX_FMT_Y10, "Y10", Layout::kWords, 0, 2, 2},
    PixelFormat{V4L2_PIX_FMT_Y12, "Y12", Layout::kWords, 0, 2, 4},
    PixelFormat{V4L2_PIX_FMT_Y14, "Y14", Layout::kWords, 0, 2, 6},
    PixelFormat{V4L2_PIX_FMT_Y16, "Y16", Layout::kWords, 0, 2, 8},
    PixelFormat{V4L2_PIX_FMT_Y16_BE, "Y16_BE", Layout::kBigEndianWords, 0, 2, 8},
    PixelFormat{V4L2_PIX_FMT_Y10P, "Y10P", Layout::kPacked10},
    PixelFormat{v4l2_fourcc('Y', '1', '2', 'P'), "Y12P", Layout::kPacked12},
    PixelFormat{V4L2_PIX_FMT_Y10BPACK, "Y10BPACK", Layout::kBitStream10},
    PixelFormat{V4L2_PIX_FMT_NV12, "NV12"},
    PixelFormat{V4L2_PIX_FMT_NV21, "NV21"},
    PixelFormat{V4L2_PIX_FMT_NV16, "NV16"},
    PixelFormat{V4L2_PIX_FMT_NV12M, "NV12M"},
    PixelFormat{V4L2_PIX_FMT_YUV420, "YU12"},
    PixelFormat{V4L2_PIX_FMT_YVU420, "YV12"},
    PixelFormat{V4L2_PIX_FMT_YUV422P, "422P"},
    PixelFormat{V4L2_PIX_FMT_YUYV, "YUYV", Layout::kBytes, 0, 2},
    PixelFormat{V4L2_PIX_FMT_UYVY, "UYVY", Layout::kBytes, 1, 2},
    PixelFormat{V4L2_PIX_FMT_YVYU, "YVYU", Layout::kBytes, 0, 2},
    PixelFormat{V4L2_PIX_FMT_VYUY, "VYUY", Layout::kBytes, 1, 2},
    PixelFormat{V4L2_PIX_FMT_MJPEG, "MJPEG", Layout::kJpeg},
    PixelFormat{V4L2_PIX_FMT_JPEG, "JPEG", Layout::kJpeg},
};

template <typename Predicate>
const PixelFormat* first_format(Predicate is_wanted) {
  const auto* found = std::ranges::find_if(kFormats, is_wanted);
  return found == kFormats.end() ? nullptr : found;
}

// Plain loops, which the compiler vectorises.
template <std::size_t kStep>
void pick_bytes(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = from[kStep * i];
}

template <std::size_t kLow, std::size_t kHigh>
void shift_words(const std::uint8_t* from, std::size_t count, int shift, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) {
    const int value = from[2 * i + kLow] | from[2 * i + kHigh] << 8;
    to[i] = static_cast<std::uint8_t>(std::min(value >> shift, 255));
  }
}

/// The upper bytes of groups of `kPixels`; a byte of lower bits follows each group.
template <std::size_t kPixels>
void skip_lower_bits(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = from[i + i / kPixels];
}

void upper_bits_of_ten(const std::uint8_t* from, std::size_t count, std::uint8_t* to) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t bit = 10 * i;
    const int two = from[bit / 8] << 8 | from[bit / 8 + 1];
    to[i] = static_cast<std::uint8_t>(two >> (8 - bit % 8));
  }
}

void read_row(const PixelFormat& format, const std::uint8_t* from, std::size_t count,
              std::uint8_t* to) {
  switch (format.layout) {
    case Layout::kBytes:
      if (format.step == 1) {
        std::memcpy(to, from, count);
      } else {
        pick_bytes<2>(from + format.first, count, to);
      }
      return;
    case Layout::kWords:
      return shift_words<0, 1>(from, count, format.shift, to);
    case Layout::kBigEndianWords:
      return shift_words<1, 0>(from, count, format.shift, to);
    case Layout::kPacked10:
      return skip_lower_bits<4>(from, count, to);
    case Layout::kPacked12:
      return skip_lower_bits<2>(from, count, to);
    case Layout::kBitStream10:
      return upper_bits_of_ten(from, count, to);
    case Layout::kJpeg:
      return;
  }
}

/// Error handler of libjpeg; it must not return from an error.
struct JpegErrors {
  jpeg_error_mgr manager{};  ///< First: libjpeg passes its address only.
  std::jmp_buf way_out{};
  int damaged{};  ///< Number of the first message about wrong pixels; 0: none.
};

JpegErrors& errors_of(j_common_ptr jpeg) { return *reinterpret_cast<JpegErrors*>(jpeg->err); }

// Others are harmless and regular with some cameras (bytes between markers).
bool means_wrong_pixels(int message) {
  return message == JWRN_HIT_MARKER || message == JWRN_JPEG_EOF || message == JWRN_HUFF_BAD_CODE ||
         message == JWRN_MUST_RESYNC || message == JWRN_NOT_SEQUENTIAL;
}

void leave(j_common_ptr jpeg) { std::longjmp(errors_of(jpeg).way_out, 1); }

void note(j_common_ptr jpeg, int level) {
  JpegErrors& errors = errors_of(jpeg);
  const int message = errors.manager.msg_code;
  if (level < 0 && errors.damaged == 0 && means_wrong_pixels(message)) errors.damaged = message;
}

void ignore(j_common_ptr) {}

}  // namespace

std::span<const PixelFormat> pixel_formats() { return kFormats; }

const PixelFormat* pixel_format(std::uint32_t code) {
  return first_format([code](const PixelFormat& f) { return f.code == code; });
}
const PixelFormat* pixel_format(std::string_view name) {
  return first_format([name](const PixelFormat& f) { return f.name == name; });
}

std::string code_text(std::uint32_t code) {
  std::string text;
  for (int i = 0; i < 4; ++i) {
    const char c = static_cast<char>(code >> (8 * i) & 0x7f);
    text += c >= ' ' && c <= '~' ? c : '?';
  }
  return text;
}

std::size_t row_bytes(const PixelFormat& format, int width) {
  const auto pixels = static_cast<std::size_t>(width);
  switch (format.layout) {
    case Layout::kBytes:
    case Layout::kWords:
    case Layout::kBigEndianWords:
      return pixels * format.step;
    case Layout::kPacked10:
    case Layout::kBitStream10:
      return (pixels * 10 + 7) / 8;
    case Layout::kPacked12:
      return (pixels * 12 + 7) / 8;
    case Layout::kJpeg:
      break;
  }
  return 0;
}

bool read_gray(const PixelFormat& format, std::span<const std::byte> bytes, std::size_t stride,
               GrayImage& out) {
  const auto width = static_cast<std::size_t>(out.width);
  const auto height = static_cast<std::size_t>(out.height);
  const std::size_t row = row_bytes(format, out.width);
  stride = std::max(stride, row);
  if (height == 0 || bytes.size() < stride * (height - 1) + row) return false;
  const auto* from = reinterpret_cast<const std::uint8_t*>(bytes.data());
  if (format.step == 1 && format.layout == Layout::kBytes && stride == width) {
    std::memcpy(out.pixels.data(), from, width * height);
    return true;
  }
  for (std::size_t v = 0; v < height; ++v)
    read_row(format, from + v * stride, width, out.pixels.data() + v * width);
  return true;
}

class JpegGray::Impl {
 public:
  Impl() {
    jpeg_.err = jpeg_std_error(&errors_.manager);
    errors_.manager.error_exit = leave;
    errors_.manager.emit_message = note;
    errors_.manager.output_message = ignore;
    jpeg_create_decompress(&jpeg_);
  }
  ~Impl() { jpeg_destroy_decompress(&jpeg_); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// @return nullptr on success. No objects with destructors, which longjmp would skip.
  const char* read(const unsigned char* bytes, std::size_t size, GrayImage& out) {
    errors_.damaged = 0;
    if (setjmp(errors_.way_out) != 0) {
      jpeg_.err->format_message(reinterpret_cast<j_common_ptr>(&jpeg_), text_.data());
      jpeg_abort_decompress(&jpeg_);
      return text_.data();
    }
    jpeg_mem_src(&jpeg_, bytes, static_cast<unsigned long>(size));
    jpeg_read_header(&jpeg_, TRUE);
    if (jpeg_.progressive_mode) return refuse("is a progressive JPEG, which is not supported");
    jpeg_.out_color_space = JCS_GRAYSCALE;
    jpeg_start_decompress(&jpeg_);
    if (jpeg_.output_width != static_cast<JDIMENSION>(out.width) ||
        jpeg_.output_height != static_cast<JDIMENSION>(out.height))
      return refuse("has two sizes");
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = out.pixels.data() + std::size_t{jpeg_.output_scanline} * jpeg_.output_width;
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_decompress(&jpeg_);
    return errors_.damaged == 0 ? nullptr : "is a JPEG whose data is damaged or ends too early";
  }

 private:
  const char* refuse(const char* why) {
    jpeg_abort_decompress(&jpeg_);
    return why;
  }

  jpeg_decompress_struct jpeg_{};
  JpegErrors errors_;
  std::array<char, JMSG_LENGTH_MAX> text_{};
};

JpegGray::JpegGray() : impl_(std::make_unique<Impl>()) {}
JpegGray::~JpegGray() = default;

Expected<void> JpegGray::read(std::span<const std::byte> bytes, GrayImage& out) {
  const auto size = encoded_size(bytes);
  if (!size) return tl::unexpected(size.error());
  if (*size != PixelSize{out.width, out.height})
    return fail(ErrorCode::kInvalid, "is a JPEG of " + size_text(*size) + " instead of " +
                                         size_text(out.width, out.height));
  const char* fault =
      impl_->read(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(), out);
  return fault == nullptr ? Expected<void>{} : fail(ErrorCode::kInvalid, fault);
}

}  // namespace fiducap::v4l2
