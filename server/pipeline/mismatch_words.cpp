#include "pipeline/mismatch_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

using Kind = FoundMismatch::Kind;

constexpr double kInPercent = 100.0;
constexpr double kMilli = 1e3;
// A finding is told when it has lasted for so long, and again when it has changed by this factor
// or more.
constexpr Duration kLasting = std::chrono::seconds(3);
constexpr double kChanged = 1.5;
// A refined number when it has moved by so many of the sigmas that were told.
constexpr double kMoved_sigma = 4.0;

std::string percent(double value, double sigma) {
  return fmt::format("{:.1f} ± {:.1f} %", kInPercent * std::abs(value), kInPercent * sigma);
}

std::string lens_text(const FoundMismatch& found, const CameraModel& model) {
  constexpr const char* kAdvice =
      "; the estimate reckons with it. Run fiducap calibrate camera, or set "
      "estimator.refine_intrinsics: true";
  if (found.kind == Kind::kFocalLength) {
    return fmt::format(
        "camera {}: the lens seems {} {} than configured (fu {:.1f}, seems {:.1f}){}", found.camera,
        percent(found.value, found.sigma), found.value > 0 ? "longer" : "shorter", model.fu,
        model.fu * (1 + found.value), kAdvice);
  }
  if (found.kind == Kind::kDistortion) {
    const double configured = model.coefficients[0];
    return fmt::format(
        "camera {}: the lens's distortion k1 seems {:.3f} ± {:.3f}, configured {:.3f}{}",
        found.camera, configured + found.value, found.sigma, configured, kAdvice);
  }
  const bool is_u = found.kind == Kind::kCentreU;
  const double configured = is_u ? model.cu : model.cv;
  return fmt::format(
      "camera {}: the principal point seems {:.1f} ± {:.1f} px {} of where it is configured "
      "({} {:.1f}, seems {:.1f}){}",
      found.camera, std::abs(found.value), found.sigma,
      is_u ? (found.value > 0 ? "right" : "left") : (found.value > 0 ? "below" : "above"),
      is_u ? "cu" : "cv", configured, configured + found.value, kAdvice);
}

std::string refined_text(const FoundMismatch& found, const CameraModel& configured) {
  const LensEstimate& lens = found.lens;
  const CameraModel now = lens.offset.applied_to(configured);
  const std::string bend = lens.k1_sigma > 0
                               ? fmt::format(", k1 {:.3f} ± {:.3f} ({:.3f})", now.coefficients[0],
                                             lens.k1_sigma, configured.coefficients[0])
                               : std::string();
  return fmt::format(
      "camera {}: the lens is refined: fu {:.1f} ± {:.1f} (configured {:.1f}), cu {:.1f} ± {:.1f} "
      "({:.1f}), cv {:.1f} ± {:.1f} ({:.1f}){}. Run fiducap calibrate camera before you measure: "
      "{} distortion stays as configured",
      found.camera, now.fu, configured.fu * lens.focal_sigma, configured.fu, now.cu,
      lens.centre_sigma_px.x(), configured.cu, now.cv, lens.centre_sigma_px.y(), configured.cv,
      bend, bend.empty() ? "its" : "the rest of its");
}

std::string range_text(const char* sensor, const std::string& end) {
  return fmt::format(
      "the {} reaches the end of its range ({}), or an axis of it is stuck: what it says there is "
      "not used, and poses are less sure meanwhile. Set a wider range, or move more gently",
      sensor, end);
}

bool is_same(const FoundMismatch& a, const FoundMismatch& b) {
  return a.kind == b.kind && a.camera == b.camera && a.tag_id == b.tag_id;
}

/// @param said  when it was told last
bool has_changed(const FoundMismatch& now, const FoundMismatch& told) {
  const double value = now.value;
  const double said = told.value;
  if (now.kind == Kind::kLens)
    return std::abs(value - said) > kMoved_sigma * told.sigma ||
           std::abs(now.lens.offset.k1 - told.lens.offset.k1) > kMoved_sigma * told.lens.k1_sigma;
  return value * said <= 0 || std::abs(value) > kChanged * std::abs(said) ||
         std::abs(said) > kChanged * std::abs(value);
}

}  // namespace

std::string mismatch_text(const FoundMismatch& found, const std::vector<CameraMount>& cameras) {
  const char* const larger = found.value > 0 ? "larger" : "smaller";
  switch (found.kind) {
    case Kind::kFocalLength:
    case Kind::kCentreU:
    case Kind::kCentreV:
    case Kind::kDistortion:
      return lens_text(found, cameras[static_cast<std::size_t>(found.camera)].model);
    case Kind::kLens:
      return refined_text(found, cameras[static_cast<std::size_t>(found.camera)].model);
    case Kind::kReadout:
      return fmt::format(
          "camera {}: its rows seem to be exposed in turn, {:.1f} ± {:.1f} ms from first to last "
          "(a "
          "rolling shutter); the estimate reckons with it. Set cameras[].readout_s",
          found.camera, kMilli * found.value, kMilli * found.sigma);
    case Kind::kAllPrints:
      return fmt::format(
          "all tags seem {} {} than configured; the estimate reckons with it. Measure a print and "
          "correct tags.size_m or tags.sizes_m",
          percent(found.value, found.sigma), larger);
    case Kind::kOnePrint:
      return fmt::format(
          "tag {} seems {} {} than the others by its configured size; the estimate reckons with "
          "it. "
          "Measure it and correct tags.sizes_m",
          found.tag_id, percent(found.value, found.sigma), larger);
    case Kind::kImuNoise:
      return fmt::format(
          "the IMU seems {:.1f} times as noisy as configured; the estimate reckons with it. Look "
          "for vibration, or run fiducap calibrate imu",
          found.value);
    case Kind::kGyroRange:
      return range_text("gyro", fmt::format("{:.1f} rad/s", found.value));
    case Kind::kAccelRange:
      return range_text("accelerometer", fmt::format("{:.0f} m/s²", found.value));
    case Kind::kStampJitter:
      return fmt::format(
          "the images' stamps seem to jitter by {:.1f} ms; the estimate reckons with it. Take the "
          "stamps of the camera or its driver instead of those of arrival",
          kMilli * found.value);
  }
  return {};
}

std::vector<FoundMismatch> MismatchNews::take(const std::vector<FoundMismatch>& found,
                                              Instant now) {
  std::vector<FoundMismatch> news;
  std::erase_if(known_, [&](const Known& known) {
    return !known.is_said && std::none_of(found.begin(), found.end(), [&](const auto& now_found) {
      return is_same(known.found, now_found);
    });
  });
  for (const FoundMismatch& one : found) {
    auto known = std::find_if(known_.begin(), known_.end(),
                              [&](const Known& k) { return is_same(k.found, one); });
    if (known == known_.end()) {
      known_.push_back({one, now, false});
      continue;
    }
    const bool is_due =
        known->is_said ? has_changed(one, known->found) : now - known->since >= kLasting;
    if (!is_due) {
      if (known->is_said) known->since = now;
      continue;
    }
    if (known->is_said && now - known->since < kLasting) continue;
    known->is_said = true;
    known->found = one;
    known->since = now;
    news.push_back(one);
  }
  return news;
}

}  // namespace fiducap
