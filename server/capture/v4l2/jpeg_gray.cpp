#include "capture/v4l2/jpeg_gray.hpp"

#include <array>
#include <csetjmp>
#include <cstdio>
#include <string>

#include <jerror.h>
#include <jpeglib.h>

#include "capture/encoded_size.hpp"

namespace fiducap::v4l2 {
namespace {

/// libjpeg's way to say that something is wrong: it must not return from an error.
struct Complaints {
  jpeg_error_mgr manager{};  ///< First: libjpeg knows the address of this one only.
  std::jmp_buf way_out{};
  int damaged{};  ///< Number of the first message that means that pixels are wrong; 0: none.
};

Complaints& complaints_of(j_common_ptr jpeg) { return *reinterpret_cast<Complaints*>(jpeg->err); }

// Others are harmless, and some cameras have them in each image (bytes between markers).
bool means_wrong_pixels(int message) {
  return message == JWRN_HIT_MARKER || message == JWRN_JPEG_EOF || message == JWRN_HUFF_BAD_CODE ||
         message == JWRN_MUST_RESYNC || message == JWRN_NOT_SEQUENTIAL;
}

void leave(j_common_ptr jpeg) { std::longjmp(complaints_of(jpeg).way_out, 1); }

void note(j_common_ptr jpeg, int level) {
  Complaints& complaints = complaints_of(jpeg);
  const int message = complaints.manager.msg_code;
  if (level < 0 && complaints.damaged == 0 && means_wrong_pixels(message))
    complaints.damaged = message;
}

void say_nothing(j_common_ptr) {}

}  // namespace

class JpegGray::Impl {
 public:
  Impl() {
    jpeg_.err = jpeg_std_error(&complaints_.manager);
    complaints_.manager.error_exit = leave;
    complaints_.manager.emit_message = note;
    complaints_.manager.output_message = say_nothing;
    jpeg_create_decompress(&jpeg_);
  }
  ~Impl() { jpeg_destroy_decompress(&jpeg_); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// nullptr: all of it was read. No objects that a jump would skip.
  const char* read(const unsigned char* bytes, std::size_t size, GrayImage& out) {
    complaints_.damaged = 0;
    if (setjmp(complaints_.way_out) != 0) {
      jpeg_.err->format_message(reinterpret_cast<j_common_ptr>(&jpeg_), text_.data());
      jpeg_abort_decompress(&jpeg_);
      return text_.data();
    }
    jpeg_mem_src(&jpeg_, bytes, static_cast<unsigned long>(size));
    jpeg_read_header(&jpeg_, TRUE);
    if (jpeg_.progressive_mode) return refuse("is a progressive JPEG, which no camera makes");
    jpeg_.out_color_space = JCS_GRAYSCALE;
    jpeg_start_decompress(&jpeg_);
    if (jpeg_.output_width != static_cast<JDIMENSION>(out.width) ||
        jpeg_.output_height != static_cast<JDIMENSION>(out.height))
      return refuse("is of two sizes");
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = out.pixels.data() + std::size_t{jpeg_.output_scanline} * jpeg_.output_width;
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_decompress(&jpeg_);
    return complaints_.damaged == 0 ? nullptr : "is a JPEG whose data is damaged or ends too early";
  }

 private:
  const char* refuse(const char* why) {
    jpeg_abort_decompress(&jpeg_);
    return why;
  }

  jpeg_decompress_struct jpeg_{};
  Complaints complaints_;
  std::array<char, JMSG_LENGTH_MAX> text_{};
};

JpegGray::JpegGray() : impl_(std::make_unique<Impl>()) {}
JpegGray::~JpegGray() = default;

Expected<void> JpegGray::read(std::span<const std::byte> bytes, GrayImage& out) {
  const auto said = encoded_size(bytes);
  if (!said) return tl::unexpected(said.error());
  if (*said != PixelSize{out.width, out.height}) {
    return fail(ErrorCode::kInvalid, "is a JPEG of " + std::to_string(said->width) + " x " +
                                         std::to_string(said->height) + " instead of " +
                                         std::to_string(out.width) + " x " +
                                         std::to_string(out.height));
  }
  const char* wrong =
      impl_->read(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(), out);
  if (wrong != nullptr) return fail(ErrorCode::kInvalid, wrong);
  return {};
}

}  // namespace fiducap::v4l2
