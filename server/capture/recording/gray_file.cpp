#include "capture/recording/gray_file.hpp"

#include <fstream>
#include <span>
#include <string>

#include <opencv2/imgcodecs.hpp>

#include "capture/encoded_size.hpp"
#include "capture/recording/output_file.hpp"

namespace fiducap {
namespace {

constexpr std::uintmax_t kMaxImageFile_bytes = 256 << 20;
constexpr std::int64_t kMostPixels = 1 << 27;

Expected<void> read_bytes(const std::filesystem::path& path, std::vector<std::uint8_t>& bytes) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return fail(ErrorCode::kNotFound, "no such image", path.string());
  if (size == 0 || size > kMaxImageFile_bytes) {
    return fail(ErrorCode::kInvalid, "is no image: " + std::to_string(size) + " bytes",
                path.string());
  }
  bytes.resize(static_cast<std::size_t>(size));
  std::ifstream file(path, std::ios::binary);
  if (file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size)))
    return {};
  return fail(ErrorCode::kUnavailable, "cannot be read", path.string());
}

/// Nothing when the file may be decoded: an image of a few bytes may ask for gigabytes.
Expected<void> check_size(const PixelSize& said, const GrayImage* wanted,
                          const std::filesystem::path& file) {
  const std::string is = "is " + std::to_string(said.width) + " x " + std::to_string(said.height);
  if (wanted != nullptr && (said.width != wanted->width || said.height != wanted->height)) {
    return fail(ErrorCode::kInvalid,
                is + ", the calibration is for " + std::to_string(wanted->width) + " x " +
                    std::to_string(wanted->height),
                file.string());
  }
  if (std::int64_t{said.width} * said.height > kMostPixels)
    return fail(ErrorCode::kInvalid, is + ": no camera has so many pixels", file.string());
  return {};
}

/// A rotation tag of a JPEG would turn the image away from its calibration.
/// @param wanted  the size it must have; nullptr: any
Expected<cv::Mat> decode(const std::filesystem::path& file, std::vector<std::uint8_t>& scratch,
                         const GrayImage* wanted) {
  if (const auto read = read_bytes(file, scratch); !read) return tl::unexpected(read.error());
  if (const auto said = encoded_size(std::as_bytes(std::span(scratch)))) {
    if (const auto fits = check_size(*said, wanted, file); !fits)
      return tl::unexpected(fits.error());
  }
  cv::Mat decoded;
  try {
    decoded = cv::imdecode(scratch, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& broken) {
    return fail(ErrorCode::kInvalid, "is no image that can be read: " + broken.err, file.string());
  }
  if (decoded.empty())
    return fail(ErrorCode::kInvalid, "is no image that can be read", file.string());
  if (const auto fits = check_size({decoded.cols, decoded.rows}, wanted, file); !fits)
    return tl::unexpected(fits.error());
  return decoded;
}

}  // namespace

Expected<void> read_gray_file(const std::filesystem::path& file, std::vector<std::uint8_t>& scratch,
                              GrayImage& out) {
  // Not decoded straight into `out`: OpenCV 4.6 leaves its target untouched, and says nothing, when
  // the bytes are no image.
  const auto decoded = decode(file, scratch, &out);
  if (!decoded) return tl::unexpected(decoded.error());
  decoded->copyTo(cv::Mat(out.height, out.width, CV_8UC1, out.pixels.data()));
  return {};
}

Expected<void> read_gray_file_of_any_size(const std::filesystem::path& file,
                                          std::vector<std::uint8_t>& scratch, GrayImage& out) {
  const auto decoded = decode(file, scratch, nullptr);
  if (!decoded) return tl::unexpected(decoded.error());
  out.resize(decoded->cols, decoded->rows);
  decoded->copyTo(cv::Mat(out.height, out.width, CV_8UC1, out.pixels.data()));
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
