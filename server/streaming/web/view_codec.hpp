#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "detection/candidate_search.hpp"
#include "detection/image_measures.hpp"
#include "pipeline/camera_view.hpp"
#include "streaming/camera_views.hpp"

// What travels on `/api/v1/views`. The reader of pictures is web/src/view_protocol.ts.
namespace fiducap::web {

/// A camera of a body, and how somebody wants to watch it.
struct NamedWish {
  int body_id{};
  int camera{};
  ViewWish wish;

  bool operator==(const NamedWish&) const = default;
};

/// More at once are of no use to one screen.
inline constexpr std::size_t kMostWishes = 16;

/// What a page wants to see from now on: `BODY/CAMERA/WIDTH/PER_SECOND/CANDIDATES` with numbers,
/// one space between two of them, e.g. `1/0/640/10/1 2/0/320/2/0`; empty: nothing.
/// @return Error that says what was expected, and where
[[nodiscard]] Expected<std::vector<NamedWish>> parse_wishes(std::string_view text);

/// How a caller stands to the pictures.
struct ViewAccess {
  enum class Kind {
    kGranted,
    kProof,   ///< To those who prove that they know the operator's token.
    kDenied,  ///< `why` says what to do about it.
  } kind{};
  std::string why;
};

/// The answer of `/api/v1/views` to a plain request: access (`granted`, `proof` or `denied`), why,
/// cameras [{body, camera, width, height, rate_hz}].
[[nodiscard]] std::string encode_view_list(const ViewAccess& access,
                                           std::span<const CameraViews::Camera> cameras);

/// What was made of one image.
struct ViewPicture {
  int body_id{};
  std::int64_t utc_ms{};              ///< Middle of its exposure.
  int shown_width{}, shown_height{};  ///< Of the picture; outlines are in pixels of the image.
  const ImageMeasures* measures{};    ///< nullptr: there are no pixels.
  ImageBlur blur;
  bool has_candidates{};  ///< They were looked for.
  std::span<const TagCandidate> candidates{};
};

/// A message: uint32, little-endian, bytes of the JSON text that follows; then a JPEG, or nothing
/// where the source gives no images. JSON: body, camera, utc_ms, width, height, shown [w, h],
/// rate_hz, noise, speed_px_s, exposure {mean, black, white, dark, bright, steepest, histogram} or
/// null, blur {tags, focus_px, motion_px, motion_deg}, candidates (whether they were looked for),
/// outlines [{kind, id, why, margin, hamming, sharpness, fit_px, sigma_px, new, px}] with px =
/// u0 v0 … u3 v3; kind is used, rejected, expected or candidate; id is null where it was not read.
[[nodiscard]] std::string encode_view(const CameraView& view, const ViewPicture& picture,
                                      std::span<const std::uint8_t> jpeg);

}  // namespace fiducap::web
