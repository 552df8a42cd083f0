#include "capture/lens/pinhole_yaml.hpp"

#include <algorithm>

#include "capture/lens/lens_name.hpp"

namespace fiducap {

int pixels_of(double number) { return static_cast<int>(std::clamp(number, -1.0, 1e6)); }

CameraModel read_pinhole(const YamlSection& yaml, const std::string& coefficients_key) {
  CameraModel model;
  const std::string kind = yaml.text("camera_model").value_or("pinhole");
  if (kind != "pinhole") {
    yaml.complain(
        "camera_model",
        "is " + kind + ", only pinhole is supported (Kalibr: pinhole-radtan, pinhole-equi)");
    return model;  // the numbers of another model mean something else
  }
  const std::vector<double> size = yaml.required_numbers("resolution", 2);
  const std::vector<double> pinhole = yaml.required_numbers("intrinsics", 4);
  model.width = pixels_of(size[0]);
  model.height = pixels_of(size[1]);
  model.fu = pinhole[0];
  model.fv = pinhole[1];
  model.cu = pinhole[2];
  model.cv = pinhole[3];
  const std::string lens = yaml.text("distortion_model").value_or("none");
  if (const auto set = set_lens(model, lens, yaml.numbers(coefficients_key)); !set) {
    yaml.complain(coefficients_key, set.error().what);
  }
  check_model(yaml, model);
  return model;
}

void read_lens_sigmas(const YamlSection& yaml, CameraMount& mount) {
  constexpr double kLargestFocal = 1;
  constexpr double kLargestDistortion = 1;
  constexpr double kLargestCentre_px = 1e4;
  const YamlSection sigma = yaml.section("intrinsics_sigma");
  mount.focal_sigma = sigma.number("focal").value_or(mount.focal_sigma);
  mount.centre_sigma_px = sigma.number("centre_px").value_or(mount.centre_sigma_px);
  mount.k1_sigma = sigma.number("k1").value_or(mount.k1_sigma);
  if (!(mount.focal_sigma >= 0 && mount.focal_sigma < kLargestFocal && mount.centre_sigma_px >= 0 &&
        mount.centre_sigma_px < kLargestCentre_px && mount.k1_sigma >= 0 &&
        mount.k1_sigma <= kLargestDistortion))
    yaml.complain("intrinsics_sigma",
                  "must be >= 0, focal below 1, centre_px below 10000, k1 at most 1");
  mount.lens_error_px = yaml.number("lens_error_px").value_or(mount.lens_error_px);
  if (!(mount.lens_error_px >= 0 && mount.lens_error_px <= kLargestLensError_px))
    yaml.complain("lens_error_px", "must be from 0 to 10");
}

void check_model(const YamlSection& yaml, const CameraModel& model) {
  if (!yaml.check()) return;
  for (const ConfigError& error : model.check()) {
    yaml.complain(error.path, "= " + error.value + " " + error.rule);
  }
}

}  // namespace fiducap
