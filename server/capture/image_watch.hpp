#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "capture/camera_frame.hpp"
#include "capture/encoded_size.hpp"
#include "capture/image_traits.hpp"

namespace fiducap {

/// What may be wrong with the images of a camera.
enum class ImageFault {
  kDark,         ///< Too dark to see tags.
  kOverexposed,  ///< Half of it is white.
  kFrozen,       ///< The same pixels again and again.
  kDuplicated,   ///< Many images are the one before, with a new stamp.
  kHalf,         ///< A part of the image never came, or is the one before.
  kSize,         ///< Not the size that was calibrated.
  kRate,         ///< Far from the rate that is configured.
  kLost,         ///< Many images are missing.
  kUnfocused,    ///< All edges are smeared, all the time.
  kMotionBlur,   ///< Edges are smeared much of the time.
};
inline constexpr std::size_t kImageFaults = 10;

/// One word for programs: `image_dark`, …
[[nodiscard]] std::string_view name_of(ImageFault fault);

/// A condition that begins or ends.
struct ImageDoubt {
  ImageFault fault{};
  bool holds{};        ///< False: it is over.
  std::string text;    ///< What is seen, and why it may be so.
  std::string remedy;  ///< What to do; empty when it is over.
};

/// Whether something yes-or-no is mostly so, over some seconds, with hysteresis.
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

/// Looks at the images of one camera and says when something is wrong with them, and when that is
/// over. Says nothing of single images, and nothing twice.
class ImageWatch final {
 public:
  struct Promise {
    PixelSize size{};   ///< 0 x 0: any.
    double rate_hz{0};  ///< 0: any.
  };
  explicit ImageWatch(Promise promise);

  /// @return what begins or ends with this image; valid until the next one, and nearly always empty
  [[nodiscard]] std::span<const ImageDoubt> take(const CameraFrame& frame);
  [[nodiscard]] bool holds(ImageFault fault) const;

 private:
  void judge(const CameraFrame& frame, const ImageTraits& now, double since_last_s);
  void judge_repetition(const ImageTraits& now, double since_last_s);
  void judge_sharpness(const ImageTraits& now, double since_last_s);
  void judge_flow(const CameraFrame& frame, double since_last_s);
  void add(ImageFault fault, bool is_so, double since_last_s);
  void say_changes(const CameraFrame& frame);
  [[nodiscard]] std::string text_of(ImageFault fault, const CameraFrame& frame) const;

  Promise promise_;
  std::vector<LastingShare> shares_;  ///< By fault.
  std::array<bool, kImageFaults> said_{};
  std::vector<ImageDoubt> doubts_;
  std::optional<Instant> last_at_;
  std::optional<ImageTraits> last_;
  bool was_same_{false};  ///< The last image was the one before it.
  double mean_gap_s_{0};
  double seen_s_{0};
};

}  // namespace fiducap
