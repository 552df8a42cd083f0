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

void check_model(const YamlSection& yaml, const CameraModel& model) {
  if (!yaml.check()) return;
  for (const ConfigError& error : model.check()) {
    yaml.complain(error.path, "= " + error.value + " " + error.rule);
  }
}

}  // namespace fiducap
