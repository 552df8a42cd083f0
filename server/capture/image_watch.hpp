#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {

/// Statistics of a few thousand pixels of an image, to judge the camera.
struct ImageTraits {
  static constexpr std::size_t kBands = 8;  ///< Horizontal ones of equal height.

  int dark{};        ///< 5th percentile of the pixels.
  int bright{};      ///< 95th percentile.
  double white{};    ///< Share of saturated pixels.
  double missing{};  ///< Share of rows at the lower or upper end that have one value and end
                     ///< sharply: they were not transferred.
  /// Share of a clear edge's step that falls within two pixels, at the sharper edges of the image;
  /// 1 is sharp, 0.25 entirely blurred. 0: too few clear edges.
  double across{};  ///< Of edges met along rows.
  double down{};    ///< Of edges met along columns.
  /// Hashes: equal when the pixels are. Noise makes all images of a camera different.
  std::array<std::uint64_t, kBands> bands{};
  std::array<bool, kBands> is_plain{};  ///< Hardly any contrast: equality means nothing.
};

/// Less than 0.1 ms for 752 x 480. @pre the image has pixels
[[nodiscard]] ImageTraits traits_of(const GrayImage& image);

enum class ImageFault {
  kDark,         ///< Too dark to see tags.
  kOverexposed,  ///< Half of it is white.
  kFrozen,       ///< The same pixels again and again.
  kDuplicated,   ///< Many images repeat the one before with a new stamp.
  kHalf,         ///< A part of the image is missing or belongs to the one before.
  kSize,         ///< Not the calibrated size.
  kRate,         ///< Far from the configured rate.
  kLost,         ///< Many images are missing.
  kUnfocused,    ///< All edges are blurred, all the time.
  kMotionBlur,   ///< Edges are blurred much of the time.
};
inline constexpr std::size_t kImageFaults = 10;

/// Event code: `image_dark`, …
[[nodiscard]] std::string_view name_of(ImageFault fault);

struct ImageCondition {
  ImageFault fault{};
  bool holds{};        ///< False: it is over.
  std::string text;    ///< What is observed, and possible causes.
  std::string remedy;  ///< Empty when it is over.
};

/// Low-pass filtered share of a boolean, with hysteresis.
class LastingShare final {
 public:
  struct Limits {
    double begins{0.8};
    double ends{0.2};
    double memory_s{2};
  };
  explicit LastingShare(Limits limits) : limits_(limits) {}
  void add(bool is_so, double since_last_s);
  [[nodiscard]] double share() const { return share_; }
  [[nodiscard]] bool holds() const { return holds_; }

 private:
  Limits limits_;
  double share_{0};
  bool holds_{false};
};

/// Monitors the images of one camera and reports when a lasting fault begins and ends.
class ImageWatch final {
 public:
  struct Nominal {
    PixelSize size{};   ///< 0 x 0: any.
    double rate_hz{0};  ///< 0: any.
  };
  explicit ImageWatch(Nominal nominal);

  /// @return conditions that begin or end with this image; valid until the next one
  [[nodiscard]] std::span<const ImageCondition> take(const CameraFrame& frame);
  [[nodiscard]] bool holds(ImageFault fault) const;

 private:
  void check(const CameraFrame& frame, const ImageTraits& now, double since_last_s);
  void check_repetition(const ImageTraits& now, double since_last_s);
  void check_flow(const CameraFrame& frame, double since_last_s);
  void add(ImageFault fault, bool is_so, double since_last_s);
  void report_changes(const CameraFrame& frame);
  [[nodiscard]] std::string text_of(ImageFault fault, const CameraFrame& frame) const;

  Nominal nominal_;
  std::vector<LastingShare> shares_;        ///< By fault.
  std::array<bool, kImageFaults> holds_{};  ///< By fault; of two with one cause the worse only.
  std::vector<ImageCondition> changes_;
  std::optional<Instant> last_at_;
  std::optional<ImageTraits> last_;
  bool was_same_{false};  ///< The last image was the one before it.
  double mean_gap_s_{0};
  double seen_s_{0};
};

}  // namespace fiducap
