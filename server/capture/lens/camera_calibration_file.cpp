#include "capture/lens/camera_calibration_file.hpp"

#include <cmath>

#include "base/yaml_section.hpp"
#include "capture/lens/lens_name.hpp"
#include "capture/lens/pinhole_yaml.hpp"

namespace fiducap {
namespace {

void set_size(const std::vector<double>& size, CameraModel& model) {
  model.width = pixels_of(size[0]);
  model.height = pixels_of(size[1]);
}

void set_pinhole(const YamlSection& yaml, const std::string& key, CameraModel& model) {
  const std::vector<double> K = yaml.required_numbers(key, 9);
  model.fu = K[0];
  model.fv = K[4];
  model.cu = K[2];
  model.cv = K[5];
  const bool is_pinhole = std::abs(K[1]) < 1e-6 && K[3] == 0 && K[6] == 0 && K[7] == 0 && K[8] == 1;
  if (!is_pinhole) yaml.complain(key, "must be [f 0 c; 0 f c; 0 0 1]: skew is not supported");
}

void set_lens_of(const YamlSection& yaml, const std::string& key, const std::string& name,
                 CameraModel& model) {
  if (const auto set = set_lens(model, name, yaml.numbers(key)); !set)
    yaml.complain(key, set.error().what);
}

// Where OpenCV's files do not name the lens, the number of coefficients decides, unless it fits two
// lenses.
std::string lens_of_opencv(const YamlSection& yaml) {
  if (const auto name = yaml.text("distortion_model"))
    return *name == "rational_polynomial" ? "plumb_bob" : *name;
  if (const auto fisheye = yaml.integer("fisheye_model"))
    return *fisheye != 0 ? "fisheye" : "plumb_bob";
  if (yaml.numbers("distortion_coefficients").size() == 4) {
    yaml.complain("distortion_coefficients",
                  "has 4 numbers and no distortion_model beside it: add distortion_model: "
                  "plumb_bob or equidistant");
  }
  return "plumb_bob";
}

std::vector<double> size_of_opencv(const YamlSection& yaml) {
  if (yaml.has("image_width") || yaml.has("image_height")) {
    return {yaml.required_number("image_width"), yaml.required_number("image_height")};
  }
  for (const char* key : {"resolution", "img_size", "image_size"}) {
    if (!yaml.has(key)) continue;
    if (!yaml.is_map(key)) return yaml.required_numbers(key, 2);
    const YamlSection size = yaml.section(key);
    if (size.has("width")) return {size.required_number("width"), size.required_number("height")};
    return {size.required_number("x"), size.required_number("y")};
  }
  yaml.complain("image_width", "is missing, and so are image_height, resolution and img_size");
  return {0, 0};
}

CameraModel read_opencv(const YamlSection& yaml) {
  CameraModel model;
  set_pinhole(yaml, "camera_matrix", model);
  set_size(size_of_opencv(yaml), model);
  set_lens_of(yaml, "distortion_coefficients", lens_of_opencv(yaml), model);
  return model;
}

CameraModel read_plain_json(const YamlSection& yaml) {
  CameraModel model;
  set_pinhole(yaml, "K", model);
  set_size({yaml.required_number("width"), yaml.required_number("height")}, model);
  set_lens_of(yaml, "dist_k1k2p1p2k3", "plumb_bob", model);
  return model;
}

}  // namespace

Expected<CameraModel> read_camera_calibration(const std::string& path) {
  const auto mount = read_camera_calibration(path, {});
  if (!mount) return tl::unexpected(mount.error());
  return mount->model;
}

Expected<CameraMount> read_camera_calibration(const std::string& path, CameraMount mount) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  CameraModel& model = mount.model;
  if (yaml->has("intrinsics") && yaml->has("resolution")) {
    model = read_pinhole(*yaml, "distortion_coefficients");
  } else if (yaml->has("camera_matrix")) {
    model = read_opencv(*yaml);
  } else if (yaml->has("K") && yaml->has("dist_k1k2p1p2k3")) {
    model = read_plain_json(*yaml);
  } else if (yaml->has("cam0")) {
    return fail(ErrorCode::kInvalid,
                "is a Kalibr camchain; name it as such, it holds extrinsics as well", path);
  } else {
    return fail(ErrorCode::kInvalid,
                "is no camera calibration: expected the keys intrinsics + resolution (EuRoC), "
                "camera_matrix + "
                "distortion_coefficients (OpenCV, ROS, WPILib) or K + dist_k1k2p1p2k3",
                path);
  }
  check_model(*yaml, model);
  read_lens_sigmas(*yaml, mount);
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  return mount;
}

}  // namespace fiducap
