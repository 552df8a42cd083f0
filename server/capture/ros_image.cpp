#include "capture/ros_image.hpp"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>

namespace fiducap::ros {
namespace {

constexpr std::string_view kCompressed = "/compressed";
constexpr int kCopy = -1;
constexpr int kHalve16 = -2;

/// Conversion of an encoding of sensor_msgs to gray.
struct Encoding {
  std::string_view name;
  int bytes_per_pixel;
  int type;
  int conversion;  ///< Of OpenCV, or one of the above.
};

constexpr std::array<Encoding, 18> kEncodings{{
    {"mono8", 1, CV_8UC1, kCopy},
    {"8UC1", 1, CV_8UC1, kCopy},
    {"mono16", 2, CV_16UC1, kHalve16},
    {"16UC1", 2, CV_16UC1, kHalve16},
    {"bgr8", 3, CV_8UC3, cv::COLOR_BGR2GRAY},
    {"8UC3", 3, CV_8UC3, cv::COLOR_BGR2GRAY},
    {"rgb8", 3, CV_8UC3, cv::COLOR_RGB2GRAY},
    {"bgra8", 4, CV_8UC4, cv::COLOR_BGRA2GRAY},
    {"8UC4", 4, CV_8UC4, cv::COLOR_BGRA2GRAY},
    {"rgba8", 4, CV_8UC4, cv::COLOR_RGBA2GRAY},
    {"yuv422", 2, CV_8UC2, cv::COLOR_YUV2GRAY_UYVY},
    {"uyvy", 2, CV_8UC2, cv::COLOR_YUV2GRAY_UYVY},
    {"yuv422_yuy2", 2, CV_8UC2, cv::COLOR_YUV2GRAY_YUY2},
    {"yuyv", 2, CV_8UC2, cv::COLOR_YUV2GRAY_YUY2},
    // OpenCV names a pattern by its second row, ROS by its first.
    {"bayer_rggb8", 1, CV_8UC1, cv::COLOR_BayerBG2GRAY},
    {"bayer_bggr8", 1, CV_8UC1, cv::COLOR_BayerRG2GRAY},
    {"bayer_gbrg8", 1, CV_8UC1, cv::COLOR_BayerGR2GRAY},
    {"bayer_grbg8", 1, CV_8UC1, cv::COLOR_BayerGB2GRAY},
}};

const Encoding* find(std::string_view name) {
  const auto* found = std::ranges::find(kEncodings, name, &Encoding::name);
  return found == kEncodings.end() ? nullptr : found;
}

std::string printable(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 32)) out += c >= ' ' && c <= '~' ? c : '.';
  return out;
}

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

Expected<void> read_distortion(const CameraInfo& info, CameraModel& model) {
  const std::string_view name = info.distortion_model;
  const std::size_t count = info.coefficients.size();
  const bool is_fisheye = name == "equidistant" || name == "fisheye";
  if (name == "plumb_bob" && (count == 4 || count == 5)) {
    model.distortion = Distortion::kRadialTangential;
  } else if (is_fisheye && (count == 4 || count == 0)) {
    model.distortion = Distortion::kEquidistant;
  } else if (count != 0) {
    return fail(ErrorCode::kUnsupported,
                "lens model \"" + printable(name) + "\" with " + std::to_string(count) +
                    " coefficients is not supported (plumb_bob, equidistant)");
  }
  for (std::size_t i = 0; i < count; ++i) model.coefficients[i] = info.coefficients[i];
  return {};
}

}  // namespace

Expected<void> to_gray(const RawImage& image, const CameraModel& camera, GrayImage& out) {
  if (const auto fits = check_size(image.width, image.height, camera); !fits) return fits;
  const Encoding* encoding = find(image.encoding);
  if (encoding == nullptr)
    return fail(ErrorCode::kUnsupported,
                "encoding \"" + printable(image.encoding) + "\" is not supported");
  const std::uint64_t row =
      std::uint64_t{image.width} * static_cast<std::uint64_t>(encoding->bytes_per_pixel);
  const std::uint64_t needed = std::uint64_t{image.step} * (std::uint64_t{image.height} - 1) + row;
  if (image.step < row || image.data.size() < needed)
    return fail(ErrorCode::kTruncated, "needs " + std::to_string(needed) +
                                           " bytes in rows of at least " + std::to_string(row) +
                                           ", received " + std::to_string(image.data.size()) +
                                           " in rows of " + std::to_string(image.step));
  out.resize(camera.width, camera.height);
  cv::Mat gray(camera.height, camera.width, CV_8UC1, out.pixels.data());
  if (encoding->conversion == kHalve16) {
    // The high byte; a row may begin at an odd address.
    const std::size_t high = image.is_bigendian ? 0 : 1;
    for (int y = 0; y < camera.height; ++y) {
      const std::uint8_t* from =
          image.data.data() + std::size_t{image.step} * static_cast<std::size_t>(y) + high;
      std::uint8_t* to = gray.ptr(y);
      for (int x = 0; x < camera.width; ++x) to[x] = from[2 * x];
    }
    return {};
  }
  const cv::Mat view(camera.height, camera.width, encoding->type,
                     const_cast<std::uint8_t*>(image.data.data()), image.step);
  if (encoding->conversion == kCopy) {
    view.copyTo(gray);
  } else {
    cv::cvtColor(view, gray, encoding->conversion);
  }
  return {};
}

Expected<void> decode_gray(std::span<const std::uint8_t> encoded, const CameraModel& camera,
                           GrayImage& out) {
  const auto size = encoded_size(std::as_bytes(encoded));
  if (!size) return tl::unexpected(size.error());
  if (const auto fits = check_size(size->width, size->height, camera); !fits) return fits;
  // An image is at most as large as its pixels in 16-bit colour.
  const auto most =
      static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height) * 8 + 65536;
  if (encoded.size() > most) return fail(ErrorCode::kInvalid, "is larger than its pixels");
  // Not into `out`: OpenCV leaves its target unchanged without an error when the header is broken.
  cv::Mat decoded;
  try {
    const cv::Mat bytes(1, static_cast<int>(encoded.size()), CV_8UC1,
                        const_cast<std::uint8_t*>(encoded.data()));
    decoded = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& failure) {
    return fail(ErrorCode::kInvalid, "cannot be decoded: " + printable(failure.what()));
  }
  if (decoded.empty() || decoded.type() != CV_8UC1)
    return fail(ErrorCode::kInvalid, "cannot be decoded");
  if (const auto fits = check_size(decoded.cols, decoded.rows, camera); !fits) return fits;
  out.resize(camera.width, camera.height);
  decoded.copyTo(cv::Mat(camera.height, camera.width, CV_8UC1, out.pixels.data()));
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
  if (of_rectified && info.P[0] > 0 && info.P[5] > 0) {
    std::tie(model.fu, model.fv, model.cu, model.cv) =
        std::tie(info.P[0], info.P[5], info.P[2], info.P[6]);
  } else {
    std::tie(model.fu, model.fv, model.cu, model.cv) =
        std::tie(info.K[0], info.K[4], info.K[2], info.K[5]);
    if (const auto read = read_distortion(info, model); !read) return tl::unexpected(read.error());
    const auto is_zero = [](double k) { return k == 0; };
    if (of_rectified && !std::ranges::all_of(info.coefficients, is_zero))
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
