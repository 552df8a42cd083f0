#include "capture/ros_image.hpp"

#include <algorithm>
#include <bit>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "base/text.hpp"
#include "capture/lens/calibration_files.hpp"

namespace fiducap::ros {
namespace {

constexpr std::string_view kCompressed = "/compressed";
constexpr int kCopy = -1;

/// Conversion of an encoding of sensor_msgs to gray.
struct Encoding {
  std::string_view name;
  int channels;
  int bytes;       ///< Per channel.
  int conversion;  ///< Of OpenCV, of 8-bit channels, or kCopy.
};

// OpenCV names a pattern by its second row, ROS by its first. The first plane of NV12, NV21 and
// NV24 is the brightness.
constexpr std::array<Encoding, 31> kEncodings{{
    {"mono8", 1, 1, kCopy},
    {"8UC1", 1, 1, kCopy},
    {"nv12", 1, 1, kCopy},
    {"nv21", 1, 1, kCopy},
    {"nv24", 1, 1, kCopy},
    {"mono16", 1, 2, kCopy},
    {"16UC1", 1, 2, kCopy},
    {"bgr8", 3, 1, cv::COLOR_BGR2GRAY},
    {"8UC3", 3, 1, cv::COLOR_BGR2GRAY},
    {"rgb8", 3, 1, cv::COLOR_RGB2GRAY},
    {"bgra8", 4, 1, cv::COLOR_BGRA2GRAY},
    {"8UC4", 4, 1, cv::COLOR_BGRA2GRAY},
    {"rgba8", 4, 1, cv::COLOR_RGBA2GRAY},
    {"bgr16", 3, 2, cv::COLOR_BGR2GRAY},
    {"16UC3", 3, 2, cv::COLOR_BGR2GRAY},
    {"rgb16", 3, 2, cv::COLOR_RGB2GRAY},
    {"bgra16", 4, 2, cv::COLOR_BGRA2GRAY},
    {"16UC4", 4, 2, cv::COLOR_BGRA2GRAY},
    {"rgba16", 4, 2, cv::COLOR_RGBA2GRAY},
    {"yuv422", 2, 1, cv::COLOR_YUV2GRAY_UYVY},
    {"uyvy", 2, 1, cv::COLOR_YUV2GRAY_UYVY},
    {"yuv422_yuy2", 2, 1, cv::COLOR_YUV2GRAY_YUY2},
    {"yuyv", 2, 1, cv::COLOR_YUV2GRAY_YUY2},
    {"bayer_rggb8", 1, 1, cv::COLOR_BayerBG2GRAY},
    {"bayer_bggr8", 1, 1, cv::COLOR_BayerRG2GRAY},
    {"bayer_gbrg8", 1, 1, cv::COLOR_BayerGR2GRAY},
    {"bayer_grbg8", 1, 1, cv::COLOR_BayerGB2GRAY},
    {"bayer_rggb16", 1, 2, cv::COLOR_BayerBG2GRAY},
    {"bayer_bggr16", 1, 2, cv::COLOR_BayerRG2GRAY},
    {"bayer_gbrg16", 1, 2, cv::COLOR_BayerGR2GRAY},
    {"bayer_grbg16", 1, 2, cv::COLOR_BayerGB2GRAY},
}};

const Encoding* find(std::string_view name) {
  const auto* found = std::ranges::find(kEncodings, name, &Encoding::name);
  return found == kEncodings.end() ? nullptr : found;
}

constexpr std::size_t kShownName = 32;

Expected<void> check_size(std::int64_t width, std::int64_t height, const CameraModel& camera) {
  if (width == camera.width && height == camera.height) return {};
  return fail(ErrorCode::kInvalid, "images are " + size_text(width, height) +
                                       ", the calibration is for " +
                                       size_text(camera.width, camera.height));
}

std::string without_compressed(const std::string& image_topic) {
  return is_compressed(image_topic) ? image_topic.substr(0, image_topic.size() - kCompressed.size())
                                    : image_topic;
}

/// The encoding of an image whose bytes are there.
Expected<const Encoding*> encoding_of(const RawImage& image) {
  const Encoding* encoding = find(image.encoding);
  if (encoding == nullptr)
    return fail(ErrorCode::kUnsupported,
                "encoding \"" + printable(image.encoding, kShownName) + "\" is not supported");
  const std::uint64_t row =
      std::uint64_t{image.width} * static_cast<std::uint64_t>(encoding->channels * encoding->bytes);
  const std::uint64_t needed =
      std::max<std::uint64_t>(image.step, row) * (std::uint64_t{image.height} - 1) + row;
  if (image.height == 0 || image.step < row || image.data.size() < needed)
    return fail(ErrorCode::kTruncated, "needs " + std::to_string(needed) +
                                           " bytes in rows of at least " + std::to_string(row) +
                                           ", received " + std::to_string(image.data.size()) +
                                           " in rows of " + std::to_string(image.step));
  return encoding;
}

/// Calls `take(row, column, value)` for all 16-bit channels. A row may begin at an odd address.
template <typename Take>
void each_16(const RawImage& image, const Encoding& encoding, Take take) {
  const std::size_t high = image.is_bigendian ? 0 : 1;
  const std::size_t columns =
      std::size_t{image.width} * static_cast<std::size_t>(encoding.channels);
  for (std::size_t y = 0; y < image.height; ++y) {
    const std::uint8_t* from = image.data.data() + std::size_t{image.step} * y;
    for (std::size_t x = 0; x < columns; ++x)
      take(y, x, static_cast<unsigned>(from[2 * x + high]) << 8 | from[2 * x + 1 - high]);
  }
}

}  // namespace

int used_bits(const RawImage& image) {
  const auto encoding = encoding_of(image);
  if (!encoding || (*encoding)->bytes == 1) return 8;
  std::array<std::uint64_t, 17> widths{};
  each_16(image, **encoding, [&](std::size_t, std::size_t, unsigned value) {
    ++widths[static_cast<std::size_t>(std::bit_width(value))];
  });
  return bits_of(widths);
}

Expected<void> GrayConversion::convert(const RawImage& image, const CameraModel& camera,
                                       GrayImage& out) {
  if (const auto fits = check_size(image.width, image.height, camera); !fits) return fits;
  const auto found = encoding_of(image);
  if (!found) return tl::unexpected(found.error());
  const Encoding& encoding = **found;
  out.resize(camera.width, camera.height);
  cv::Mat gray(camera.height, camera.width, CV_8UC1, out.pixels.data());
  const int type = CV_8UC(encoding.channels);
  cv::Mat view(camera.height, camera.width, type, const_cast<std::uint8_t*>(image.data.data()),
               image.step);
  if (encoding.bytes == 2) {
    bits_ = std::max(bits_, used_bits(image));
    const std::size_t columns =
        std::size_t{image.width} * static_cast<std::size_t>(encoding.channels);
    if (encoding.conversion != kCopy) scratch_.resize(columns * image.height);
    std::uint8_t* to = encoding.conversion == kCopy ? out.pixels.data() : scratch_.data();
    each_16(image, encoding, [&](std::size_t y, std::size_t x, unsigned value) {
      to[columns * y + x] = static_cast<std::uint8_t>(std::min(value >> (bits_ - 8), 255U));
    });
    view = cv::Mat(camera.height, camera.width, type, to);
  }
  if (encoding.conversion != kCopy)
    cv::cvtColor(view, gray, encoding.conversion);
  else if (view.data != gray.data)
    view.copyTo(gray);
  return {};
}

Expected<CameraModel> camera_model(const CameraInfo& info, bool of_rectified) {
  constexpr std::uint32_t kLargest = 65535;
  if (info.width == 0 || info.height == 0 || info.width > kLargest || info.height > kLargest)
    return fail(ErrorCode::kInvalid, "camera_info has no usable size");
  if (info.binning_x > 1 || info.binning_y > 1 || info.roi_x != 0 || info.roi_y != 0)
    return fail(ErrorCode::kUnsupported,
                "camera_info is for binned or cropped images: describe the camera in the "
                "configuration");
  CameraModel model;
  model.width = static_cast<int>(info.width);
  model.height = static_cast<int>(info.height);
  const bool has_K = std::ranges::any_of(info.K, [](double k) { return k != 0; });
  const bool has_P = info.P[0] > 0 && info.P[5] > 0;
  if (!has_K && !has_P)
    return fail(ErrorCode::kInvalid,
                "camera_info has no lens (K is 0): the driver has no calibration of this camera");
  if ((of_rectified || !has_K) && has_P) {
    std::tie(model.fu, model.fv, model.cu, model.cv) =
        std::tie(info.P[0], info.P[5], info.P[2], info.P[6]);
  } else {
    std::tie(model.fu, model.fv, model.cu, model.cv) =
        std::tie(info.K[0], info.K[4], info.K[2], info.K[5]);
    // Drivers leave the list empty when nothing is bent.
    constexpr std::array<double, 4> kZeros{};
    const std::span<const double> given =
        info.coefficients.empty() ? std::span<const double>(kZeros) : info.coefficients;
    if (const auto set = set_lens(model, std::string(info.distortion_model), given); !set)
      return tl::unexpected(set.error());
    const auto is_zero = [](double k) { return k == 0; };
    if (of_rectified && !std::ranges::all_of(given, is_zero))
      return fail(ErrorCode::kUnsupported,
                  "the images are rectified, but camera_info has only the lens of the unrectified "
                  "ones (P is empty): use those, or describe the camera in the configuration");
  }
  if (const auto errors = model.check(); !errors.empty())
    return fail(ErrorCode::kInvalid, errors.front().text());
  return model;
}

bool is_compressed(const std::string& image_topic) { return image_topic.ends_with(kCompressed); }

bool is_rectified(const std::string& image_topic) {
  const std::string base = without_compressed(image_topic);
  return base.find("rect", base.rfind('/') + 1) != std::string::npos;
}

std::string camera_info_topic(const std::string& image_topic) {
  const std::string base = without_compressed(image_topic);
  return base.substr(0, base.rfind('/')) + "/camera_info";
}

}  // namespace fiducap::ros
