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
#include "streaming/page_api.hpp"

// Messages of `/api/v1/views`. Reader of pictures: web/src/view_protocol.ts.
namespace fiducap::web {

/// A request for previews of a body's camera.
struct CameraRequest {
  int body_id{};
  int camera{};
  ViewRequest request;

  bool operator==(const CameraRequest&) const = default;
};

/// Cameras per page.
inline constexpr std::size_t kMostViewRequests = 16;

/// The cameras of a page: `BODY/CAMERA/WIDTH/PER_SECOND/CANDIDATES` with numbers, separated by one
/// space, e.g. `1/0/640/10/1 2/0/320/2/0`; empty: none.
/// @return Error with what was expected, and where
[[nodiscard]] Expected<std::vector<CameraRequest>> parse_view_requests(std::string_view text);

/// Access of a client to the pictures.
struct ViewAccess {
  enum class Kind {
    kGranted,
    kProof,   ///< With a proof of a token.
    kDenied,  ///< `why` has the remedy.
  } kind{};
  std::string why;
  bool for_readers{};  ///< A proof of the token for reading is enough.
};

/// The reply of `/api/v1/views` to a plain request: access (`granted`, `proof` or `denied`), why,
/// cameras [{body, camera, width, height, rate_hz}].
[[nodiscard]] std::string encode_view_list(const ViewAccess& access,
                                           std::span<const CameraViews::Camera> cameras);

/// Picture and measures of one image.
struct ViewPicture {
  int body_id{};
  std::int64_t utc_ms{};              ///< Middle of its exposure.
  int shown_width{}, shown_height{};  ///< Of the picture; outlines are in pixels of the image.
  const ImageMeasures* measures{};    ///< nullptr: no pixels.
  ImageBlur blur;
  bool has_candidates{};  ///< They were searched for.
  std::span<const TagCandidate> candidates{};
};

/// A message: uint32, little-endian, bytes of the JSON text that follows; then a JPEG, or nothing
/// where the source gives no images. JSON: body, camera, utc_ms, width, height, shown [w, h],
/// rate_hz, noise, speed_px_s, exposure {mean, black, white, dark, bright, steepest, histogram} or
/// null, blur {tags, focus_px, motion_px, motion_deg}, candidates (whether they were searched for),
/// outlines [{kind, id, why, margin, hamming, sharpness, fit_px, sigma_px, new, px}] with px =
/// u0 v0 … u3 v3; kind is used, rejected, expected or candidate; id is null where it was not read.
[[nodiscard]] std::string encode_view(const CameraView& view, const ViewPicture& picture,
                                      std::span<const std::uint8_t> jpeg);

}  // namespace fiducap::web
