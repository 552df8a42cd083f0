#include "daemon/bodies/calibration_report.hpp"

#include <fmt/format.h>

#include <cmath>

#include "capture/lens/calibrated_mount.hpp"

namespace fiducap {

namespace {

// A sigma above this share of what was told has learned nothing that matters.
constexpr double kNothingLearned = 0.7;

std::string part(const char* what, double sigma, double told_sigma, double unit,
                 const char* unit_name, const char* cure) {
  if (told_sigma == 0) return fmt::format("{} taken as exact", what);
  if (sigma > kNothingLearned * told_sigma)
    return fmt::format("{} not shown by this motion ({})", what, cure);
  return fmt::format("{} ±{:.2g} {}", what, sigma * unit, unit_name);
}

/// Of a lens that is estimated.
std::string lens_part(const LensEstimate& learned, const CameraMount& told) {
  constexpr double kPercent = 100;
  constexpr double kAsCalibrated_sigma = 4;
  if (tells_a_calibration(told) &&
      std::abs(learned.offset.focal) < kAsCalibrated_sigma * told.focal_sigma)
    return ", lens as calibrated";
  if (told.focal_sigma > 0 && learned.focal_sigma > kNothingLearned * told.focal_sigma)
    return ", lens not shown by this motion (see several tags from different places)";
  std::string text;
  if (learned.focal_sigma > 0)
    text = fmt::format(", focal length {:+.2f} ±{:.2g} %", kPercent * learned.offset.focal,
                       kPercent * learned.focal_sigma);
  const bool is_k1_shown =
      told.k1_sigma == 0 || learned.k1_sigma <= kNothingLearned * told.k1_sigma;
  if (learned.k1_sigma > 0 && is_k1_shown)
    text += fmt::format(", k1 {:+.3f} ±{:.2g}", learned.offset.k1, learned.k1_sigma);
  return text;
}

}  // namespace

std::string calibration_text(std::size_t camera, const ExtrinsicsEstimate& learned,
                             const CameraMount& told) {
  constexpr double kMilli = 1e3;
  const double position = std::sqrt(learned.covariance.topLeftCorner<3, 3>().trace());
  const double rotation = std::sqrt(learned.covariance.bottomRightCorner<3, 3>().trace());
  const double per_axis = std::sqrt(3.0);
  std::string text = fmt::format("camera {}: ", camera) +
                     part("position", position, per_axis * told.position_sigma_m, kMilli, "mm",
                          "turn the body about two axes") +
                     ", " +
                     part("rotation", rotation, per_axis * told.rotation_sigma_rad, kMilli, "mrad",
                          "turn the body about two axes");
  const ClockEstimate& clock = learned.clock;
  if (clock.shift_sigma_s > 0) {
    text += clock.shift_sigma_s > kNothingLearned * told.time_shift_sigma_s
                ? std::string(", clock not shown by this motion (turn the body quickly)")
                : fmt::format(", clock {:+.2f} ±{:.2g} ms", clock.shift_s * kMilli,
                              clock.shift_sigma_s * kMilli);
  }
  if (clock.readout_sigma_s > 0)
    text += fmt::format(", readout {:.2f} ±{:.2g} ms", clock.readout_s * kMilli,
                        clock.readout_sigma_s * kMilli);
  return text + lens_part(learned.lens, told);
}

}  // namespace fiducap
