// Calibrations of a set-up.
#include <algorithm>
#include <utility>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "calibration/intrinsics/intrinsics_calibration.hpp"
#include "calibration/intrinsics/intrinsics_verdict.hpp"
#include "daemon/setup/setup_guide.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMoreViews = 12;
// Search range around a pose measured by hand.
constexpr double kMountReach_m = 0.03;
constexpr double kMountReach_rad = 0.15;
constexpr double kClockReach_s = 0.12;
constexpr double kLeastClockSigma_s = 5e-4;
constexpr double kTooDark = 60;     // gray value above 99 % of an image
constexpr double kTooBright = 0.2;  // share of pixels at the upper end
constexpr double kOutOfFocus_px = 3.5;
constexpr double kSmeared_px = 3;

SetupVerdict refused(const Error& error) { return {false, true, error.text(), {}}; }

}  // namespace

void SetupGuide::judge_picture() {
  SetupPicture picture;
  const GrayImage& image = *image_.image;
  picture.width = image.width;
  picture.height = image.height;
  if (picture_) picture.rate_hz = picture_->rate_hz;
  if (last_image_at_ && image_.exposed_at > *last_image_at_) {
    constexpr double kNewest = 0.1;
    const double rate = 1 / to_seconds(image_.exposed_at - *last_image_at_);
    picture.rate_hz += (picture.rate_hz == 0 ? 1 : kNewest) * (rate - picture.rate_hz);
  }
  last_image_at_ = image_.exposed_at;
  picture.measures = measure(image);
  picture.blur = blur_of(corners_.tags);
  picture.tags = corners_.tags.size();
  if (picture.measures.white < kTooDark) {
    picture.verdict = "Too dark: more light, a longer exposure or more gain.";
  } else if (picture.measures.bright_share > kTooBright) {
    picture.verdict = "Too bright: a shorter exposure.";
  } else if (picture.blur.tags > 0 && picture.blur.focus_px > kOutOfFocus_px) {
    picture.verdict = "Out of focus: turn the lens until the edges of a tag are sharp.";
  } else if (picture.blur.tags > 0 && picture.blur.motion_px > kSmeared_px) {
    picture.verdict = "Smeared by motion: a shorter exposure, and more light.";
  } else {
    picture.is_good = true;
    picture.verdict = picture.tags > 0 ? "Well exposed and sharp."
                                       : "Well exposed. Show a tag to check the focus.";
  }
  picture_ = std::move(picture);
}

/// A good lens ends the step; a weak one needs more images, but may be used.
void SetupGuide::solve_lens() {
  is_solving_ = true;
  show_();
  const auto solved = calibrate_intrinsics(lens_->data(), {}, [](const std::string&) {});
  is_solving_ = false;
  if (!solved) {
    forget_lens();
    verdict_ = refused(solved.error());
    return lens_->request_more(kMoreViews, solved.error().what);
  }
  const IntrinsicsVerdict judged = assess(*solved, make_image_map(*solved));
  const bool usable = judged.grade != IntrinsicsGrade::kUseless;
  verdict_ = SetupVerdict{judged.grade == IntrinsicsGrade::kGood, !usable,
                          std::to_string(solved->data.views.size()) + " views, corners fit to " +
                              fixed(judged.reprojection_rms_px, 2) + " px",
                          judged.advice};
  forget_lens();  // also one of fewer views: it was of the same lens
  if (usable) {
    CameraMount& mount = result_.camera.mount;
    mount.model = solved->state.camera;
    set_lens_sigmas(*solved, judged, mount);  // is learned on; what no number of it follows stays
    result_.lens_from = "calibrated, " + verdict_->summary;
  }
  if (!verdict_->is_good)
    lens_->request_more(kMoreViews, judged.advice.empty() ? "" : judged.advice.front());
  show_();
}

void SetupGuide::solve_rest() {
  const auto noise = rest_.result();
  if (!noise) {
    verdict_ = refused(noise.error());
    return show_();
  }
  const double gyro_range = result_.imu->gyro_range_rad_s;
  const double accel_range = result_.imu->accel_range_m_s2;
  result_.imu = noise->noise;
  result_.imu->gyro_range_rad_s = gyro_range;
  result_.imu->accel_range_m_s2 = accel_range;
  result_.imu_from = std::string(kMeasuredAtRest) + ", " + fixed(noise->seconds, 0) + " s";
  verdict_ = SetupVerdict{true,
                          false,
                          fixed(noise->rate_hz, 1) + " Hz, gyro " +
                              fixed(1e3 * noise->noise.gyro_noise_rad_s_rtHz, 3) +
                              " mrad/s/√Hz, accelerometer " +
                              fixed(1e3 * noise->noise.accel_noise_m_s2_rtHz, 2) + " mm/s²/√Hz",
                          {}};
  show_();
}

void SetupGuide::solve_wave() {
  is_solving_ = true;
  show_();
  OfflineSetup setup;
  forget_clock();  // the samples have the camera's own stamps
  CameraMount mount = result_.camera.mount;
  if (picture_ && picture_->rate_hz > 0) mount.rate_hz = picture_->rate_hz;
  setup.sensors.cameras = {mount};
  setup.sensors.imu = result_.imu;
  setup.tags = result_.tags;
  const CalibrationOptions options{kMountReach_m, kMountReach_rad, kClockReach_s, true};
  const auto solved = calibrate_camera_imu(setup, wave_.samples(), options);
  is_solving_ = false;
  if (!solved) {
    verdict_ = refused(solved.error());
    return show_();
  }
  const auto weak = weaknesses_of(*solved);
  const CameraVerdict& camera = solved->verdicts.front();
  verdict_ = SetupVerdict{
      weak.empty(), solved->time.at_border,
      "The camera is " + fixed(1e3 * camera.moved_m, 1) + " mm and " +
          fixed(camera.moved_rad * kDegreesPerRadian, 1) + " degrees from its given pose; " +
          (solved->time.determined
               ? "its stamps are " + fixed(1e3 * solved->time.shift_s, 2) + " ms early"
               : "its clock was not found"),
      weak};
  if (verdict_->is_refused) return show_();
  result_.camera.mount = solved->cameras.front();
  // A clock may drift after this half minute, so it continues to be estimated. A clock that was not
  // found keeps its sigma.
  if (solved->time.determined)
    result_.camera.mount.time_shift_sigma_s = std::max(kLeastClockSigma_s, solved->time.sigma_s);
  result_.mount_from = "calibrated by waving, " + fixed(solved->statistics.data_s, 0) + " s, " +
                       fixed(solved->statistics.reprojection_median_px, 2) + " px";
  show_();
}

}  // namespace fiducap
