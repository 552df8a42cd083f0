#pragma once

#include <array>
#include <limits>
#include <memory>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "capture/camera_frame.hpp"
#include "detection/tag_search.hpp"
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
  kQuarantined,    ///< In the map, not in use.
  kGate,           ///< Its corners are too far from the prediction.
  kWrongSize,      ///< … and its print is of another size than configured.
  kMoved,          ///< It kept contradicting and was dropped with this image.
  kUnstable,       ///< Dropped repeatedly: not used for some time.
  kPending,        ///< Its branch of the two poses, or the start, is undecided.
  kNoPlace,        ///< The body's pose is unknown.
  kLate,           ///< Images of this camera come too late to be used.
};
/// `gate`, `low_margin`, …
[[nodiscard]] std::string_view name_of(UnusedBecause why);

/// A detected or predicted tag in an image. Raw pixels.
struct ViewOutline {
  enum class Kind { kUsed, kRejected, kExpected } kind{};
  int tag_id{};
  UnusedBecause why{UnusedBecause::kUsed};  ///< Of a rejected one.
  bool is_new{false};                       ///< Entered the state with this image.
  int hamming{};
  double decision_margin{};  ///< 0: not known.
  double sharpness{};        ///< TagSighting's.
  double fit_px{kUnknown};   ///< RMS of its corners against the estimate after the update.
  double sigma_px{};         ///< Of an expected one.
  std::array<Eigen::Vector2d, 4> corners_px{};

  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
};

/// One image for the user: tags that were detected, predicted and used, and why not. The pixels are
/// shared, not copied. Buffers are reused from image to image.
struct CameraView {
  static constexpr std::size_t kMostOutlines = 128;

  int camera{};
  Instant exposed_at{};
  std::shared_ptr<const GrayImage> image;  ///< nullptr: the source gives corners only.
  int width{}, height{};                   ///< Of the image, or of the lens model.
  double rate_hz{};                        ///< Recent rate of the images; 0: not known yet.
  double pixel_noise{};                    ///< CornerFrame's.
  /// Speed of the tags (without any: of the centre of a distant wall) in the image by the estimate;
  /// kUnknown without one.
  double speed_px_s{ViewOutline::kUnknown};
  std::vector<TagSighting> sightings;  ///< As found, for blur and candidates.
  std::vector<ViewOutline> outlines;   ///< At most kMostOutlines; expected ones last.
};

/// Fills `view` except image and rate.
/// @param pipeline  that has just given `update`   @param map  that it was given for the image
void fill(CameraView& view, const BodyPipeline& pipeline, const BodyUpdate& update,
          const TagMap& map);

}  // namespace fiducap
