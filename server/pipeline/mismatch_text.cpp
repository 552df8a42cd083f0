#include "pipeline/doubts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/numeric.hpp"

namespace fiducap {
namespace {

using Kind = FoundMismatch::Kind;

constexpr double kInPercent = 100.0;
constexpr double kMilli = 1e3;
constexpr double kSecondsPerMinute = 60.0;
// A mismatch is reported when it has lasted this long, and again when it has changed by this
// factor.
constexpr Duration kLasting = std::chrono::seconds(3);
// While the data do not tell which of several causes is right, more of them may.
constexpr Duration kLastingAmbiguous = std::chrono::seconds(10);
constexpr double kChanged = 1.5;
// A refined number: when it has moved by this many reported sigmas.
constexpr double kMoved_sigma = 4.0;
// Distortion: once its sigma is below this, since few motions show it as soon as the focal length.
constexpr double kDistortionKnown = 0.02;

std::string percent(double value, double sigma) {
  return fmt::format("{:.1f} ± {:.1f} %", kInPercent * std::abs(value), kInPercent * sigma);
}

double k1_of(const CameraModel& model) {
  return model.distortion == Distortion::kNone ? 0.0 : model.coefficients[0];
}

std::string lens_text(const FoundMismatch& found, const CameraModel& model) {
  constexpr const char* kAdvice =
      "; this is corrected for. Run fiducap calibrate camera, or set estimator.refine_intrinsics: "
      "true";
  if (found.kind == Kind::kFocalLength)
    return fmt::format(
        "camera {}: the lens seems {} {} than configured (fu {:.1f}, seems {:.1f}){}", found.camera,
        percent(found.value, found.sigma), found.value > 0 ? "longer" : "shorter", model.fu,
        model.fu * (1 + found.value), kAdvice);
  if (found.kind == Kind::kDistortion) {
    const double configured = k1_of(model);
    return fmt::format(
        "camera {}: the lens's distortion k1 seems {:.4f} ± {:.4f}, configured {:.4f}{}",
        found.camera, configured + found.value, found.sigma, configured, kAdvice);
  }
  const bool is_u = found.kind == Kind::kCentreU;
  const double configured = is_u ? model.cu : model.cv;
  return fmt::format(
      "camera {}: the principal point seems {:.1f} ± {:.1f} px {} of where it is configured ({} "
      "{:.1f}, seems {:.1f}){}",
      found.camera, std::abs(found.value), found.sigma,
      is_u ? (found.value > 0 ? "right" : "left") : (found.value > 0 ? "below" : "above"),
      is_u ? "cu" : "cv", configured, configured + found.value, kAdvice);
}

/// A number that is refined; nothing when it is not.
std::string refined_part(const char* name, double now, double sigma, double configured,
                         int digits) {
  if (sigma <= 0) return {};
  return fmt::format(" {} {:.{}f} ± {:.{}f} (configured {:.{}f}),", name, now, digits, sigma,
                     digits, configured, digits);
}

std::string refined_text(const FoundMismatch& found, const CameraModel& configured) {
  const LensEstimate& lens = found.lens;
  const CameraModel now = lens.offset.applied_to(configured);
  std::string numbers =
      refined_part("fu", now.fu, configured.fu * lens.focal_sigma, configured.fu, 1) +
      refined_part("cu", now.cu, lens.centre_sigma_px.x(), configured.cu, 1) +
      refined_part("cv", now.cv, lens.centre_sigma_px.y(), configured.cv, 1) +
      refined_part("k1", k1_of(now), lens.k1_sigma, k1_of(configured), 4);
  if (!numbers.empty()) numbers.pop_back();  // the last comma
  return fmt::format(
      "camera {}: the lens is refined:{}. Run fiducap calibrate camera before you measure: {} "
      "distortion stays as configured",
      found.camera, numbers, lens.k1_sigma > 0 ? "the rest of its" : "its");
}

std::string range_text(const char* sensor, const std::string& end) {
  return fmt::format(
      "the {} reaches the end of its range ({}), or one of its axes is stuck: such readings are "
      "not used, and poses are less certain meanwhile. Set a wider range, or move more gently",
      sensor, end);
}

std::string axes_text(const FoundMismatch& found, double unit, const char* name) {
  const auto axis = [&](int k) {
    return fmt::format("{} {:.2f} ± {:.2f}", "xyz"[k], unit * found.axes(k),
                       unit * found.axes_sigma(k));
  };
  return fmt::format("{}, {}, {} {}", axis(0), axis(1), axis(2), name);
}

std::string motion_text(const FoundMismatch& found) {
  constexpr const char* kAdvice = "; this is corrected for. Run fiducap calibrate imu";
  if (found.kind == Kind::kAccelScale)
    return fmt::format("the accelerometer seems to read too much by {}{}",
                       axes_text(found, kInPercent, "%"), kAdvice);
  if (found.kind == Kind::kGyroScale)
    return fmt::format("the gyro seems to read too much by {}{}", axes_text(found, kInPercent, "%"),
                       kAdvice);
  if (found.kind == Kind::kGyroDrift)
    return fmt::format("the gyro's bias seems to drift by {}{}",
                       axes_text(found, kSecondsPerMinute * kDegreesPerRadian, "°/s per minute"),
                       "; this is corrected for. Let the IMU warm up before you measure");
  return fmt::format("the gyro's axes seem turned against the accelerometer's by {}{}",
                     axes_text(found, kDegreesPerRadian, "°"), kAdvice);
}

std::string mount_text(const FoundMismatch& found) {
  const bool is_place = found.kind == Kind::kMountPosition;
  return fmt::format(
      "camera {}: {} on the body differs from the configured one by {}; this is corrected for. Run "
      "fiducap calibrate extrinsics, or correct bodies[].cameras[].X_BV and its sigmas",
      found.camera, is_place ? "its position" : "its attitude",
      is_place ? axes_text(found, kMilli, "mm") : axes_text(found, kDegreesPerRadian, "°"));
}

bool is_same(const FoundMismatch& a, const FoundMismatch& b) {
  return a.kind == b.kind && a.camera == b.camera && a.tag_id == b.tag_id;
}

/// By more than the reported uncertainty.
bool has_moved(double now, double reported, double reported_sigma) {
  return reported_sigma > 0 && std::abs(now - reported) > kMoved_sigma * reported_sigma;
}

bool has_changed(const LensEstimate& now, const LensEstimate& reported) {
  const bool is_k1_new = reported.k1_sigma > kDistortionKnown && now.k1_sigma <= kDistortionKnown;
  return has_moved(now.offset.focal, reported.offset.focal, reported.focal_sigma) ||
         has_moved(now.offset.k1, reported.offset.k1, reported.k1_sigma) || is_k1_new;
}

bool has_changed(const FoundMismatch& now, const FoundMismatch& reported) {
  if (now.kind == Kind::kLens) return has_changed(now.lens, reported.lens);
  return now.value * reported.value <= 0 ||
         std::abs(now.value) > kChanged * std::abs(reported.value) ||
         std::abs(reported.value) > kChanged * std::abs(now.value);
}

}  // namespace

std::string mismatch_text(const FoundMismatch& found, const std::vector<CameraMount>& cameras) {
  if (found.is_ambiguous) {
    FoundMismatch one = found;
    one.is_ambiguous = false;
    return "one of several possible causes: " + mismatch_text(one, cameras);
  }
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
          "camera {}: it seems to have a rolling shutter, {:.1f} ± {:.1f} ms from first to last "
          "row; this is corrected for. Set cameras[].readout_s",
          found.camera, kMilli * found.value, kMilli * found.sigma);
    case Kind::kAllPrints:
      return fmt::format(
          "all tags seem {} {} than configured; this is corrected for. Measure a print and correct "
          "tags.size_m or tags.sizes_m",
          percent(found.value, found.sigma), larger);
    case Kind::kOnePrint:
      return fmt::format(
          "tag {} seems {} {} than the others by its configured size; this is corrected for. "
          "Measure it and correct tags.sizes_m",
          found.tag_id, percent(found.value, found.sigma), larger);
    case Kind::kImuNoise:
      return fmt::format(
          "the IMU seems {:.1f} times as noisy as configured; this is corrected for. Look for "
          "vibration, or run fiducap calibrate imu",
          found.value);
    case Kind::kGyroRange:
      return range_text("gyro", fmt::format("{:.1f} rad/s", found.value));
    case Kind::kAccelRange:
      return range_text("accelerometer", fmt::format("{:.0f} m/s²", found.value));
    case Kind::kStampJitter:
      return fmt::format(
          "the images' stamps seem to jitter by {:.1f} ms; this is corrected for. Use the stamps "
          "of the camera or its driver instead of the time of arrival",
          kMilli * found.value);
    case Kind::kAccelScale:
    case Kind::kGyroTurn:
    case Kind::kGyroScale:
    case Kind::kGyroDrift:
      return motion_text(found);
    case Kind::kMountPosition:
    case Kind::kMountRotation:
      return mount_text(found);
  }
  return {};
}

std::vector<FoundMismatch> MismatchReporter::take(const std::vector<FoundMismatch>& found,
                                                  Instant now) {
  std::vector<FoundMismatch> due;
  std::erase_if(known_, [&](const Known& known) {
    return !known.is_reported && std::ranges::none_of(found, [&](const auto& now_found) {
      return is_same(known.found, now_found);
    });
  });
  for (const FoundMismatch& one : found) {
    auto known =
        std::ranges::find_if(known_, [&](const Known& k) { return is_same(k.found, one); });
    if (known == known_.end()) {
      known_.push_back({one, now, false});
      continue;
    }
    const Duration lasting = one.is_ambiguous ? kLastingAmbiguous : kLasting;
    const bool is_due =
        known->is_reported ? has_changed(one, known->found) : now - known->since >= lasting;
    if (!is_due) {
      if (known->is_reported) known->since = now;
      continue;
    }
    if (known->is_reported && now - known->since < kLasting) continue;
    known->is_reported = true;
    known->found = one;
    known->since = now;
    due.push_back(one);
  }
  return due;
}

}  // namespace fiducap
