#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "capture/camera_frame.hpp"
#include "detection/tracking/expected_tag.hpp"
#include "estimation/found_mismatch.hpp"
#include "pipeline/body_pipeline.hpp"
#include "pipeline/body_update.hpp"

namespace fiducap {

/// Why a tag that was found in an image is not used.
enum class UnusedBecause {
  kUsed,           ///< It is.
  kIgnored,        ///< `tags.ignore`
  kCorrectedBits,  ///< More of them than `tags.max_hamming`.
  kLowMargin,      ///< Less than `detector.min_decision_margin`.
  kIdTwice,        ///< Its id is in this image more than once.
  kOutsideLens,    ///< Corners outside of the lens model, or no tag seen from the front there.
  kQuarantined,    ///< The map keeps it, and nobody uses it.
  kGate,           ///< Its corners are too far from where the estimate has them.
  kWrongSize,      ///< … and its print is known to be of another size than configured.
  kMoved,          ///< It kept contradicting, and was given up with this image.
  kRestless,       ///< Given up more than once lately: it has to stay away for a while.
  kPending,        ///< Which of its two poses it has, or how it all began, is not certain yet.
  kNoPlace,        ///< It is not known where the body is.
  kLate,           ///< Images of this camera come too late to be used.
};
/// `gate`, `low_margin`, …
[[nodiscard]] std::string_view name_of(UnusedBecause why);

/// A tag, or the place of one, in an image. Raw pixels.
struct ViewOutline {
  enum class Kind { kUsed, kRejected, kExpected } kind{};
  int tag_id{};
  UnusedBecause why{UnusedBecause::kUsed};  ///< Of a rejected one.
  bool is_new{false};                       ///< Entered the state with this image.
  int hamming{};
  double decision_margin{};  ///< 0: the source does not say.
  double sharpness{};        ///< TagSighting's.
  double fit_px{kUnknown};   ///< RMS of its corners against the estimate after the update.
  double sigma_px{};         ///< Of an expected one.
  std::array<Eigen::Vector2d, 4> corners_px{};

  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
};

/// One image as people look at it: what was found, what was expected, what was used and why not.
/// The pixels are shared, not copied. Buffers are reused from image to image.
struct CameraView {
  static constexpr std::size_t kMostOutlines = 128;

  int camera{};
  Instant exposed_at{};
  std::shared_ptr<const GrayImage> image;  ///< nullptr: the source gives corners only.
  int width{}, height{};                   ///< Of the image, or of the lens model.
  double rate_hz{};                        ///< Of the images, lately; 0: not known yet.
  double pixel_noise{};                    ///< CornerFrame's.
  /// How fast tags (without any: the middle of a far wall) move through the image, by the
  /// estimate; kUnknown without one.
  double speed_px_s{ViewOutline::kUnknown};
  std::vector<TagSighting> sightings;  ///< As found, for blur and candidates.
  std::vector<ViewOutline> outlines;   ///< At most kMostOutlines; expected ones last.
};

/// Writes what an image did into `view`; its image and rate are the caller's.
/// @param pipeline  that has just given `update`   @param map  that it was given for the image
void fill(CameraView& view, const BodyPipeline& pipeline, const BodyUpdate& update,
          const TagMap& map);

}  // namespace fiducap
