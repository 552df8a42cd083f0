#include "capture/lens/calibration_files.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>

#include "base/whole_file.hpp"
#include "base/yaml_section.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {
namespace {

int pixels_of(double number) { return static_cast<int>(std::clamp(number, -1.0, 1e6)); }

void check_model(const YamlSection& yaml, const CameraModel& model) {
  if (!yaml.check()) return;
  for (const ConfigError& error : model.check())
    yaml.add_fault(error.path, "= " + error.value + " " + error.rule);
}

void set_size(const std::vector<double>& size, CameraModel& model) {
  model.width = pixels_of(size[0]);
  model.height = pixels_of(size[1]);
}

void set_pinhole(const YamlSection& yaml, const std::string& key, CameraModel& model) {
  const std::vector<double> K = yaml.required_numbers(key, 9);
  std::tie(model.fu, model.fv, model.cu, model.cv) = std::tie(K[0], K[4], K[2], K[5]);
  const bool is_pinhole = std::abs(K[1]) < 1e-6 && K[3] == 0 && K[6] == 0 && K[7] == 0 && K[8] == 1;
  if (!is_pinhole) yaml.add_fault(key, "must be [f 0 c; 0 f c; 0 0 1]: skew is not supported");
}

void set_lens_of(const YamlSection& yaml, const std::string& key, const std::string& name,
                 CameraModel& model) {
  if (const auto set = set_lens(model, name, yaml.numbers(key)); !set)
    yaml.add_fault(key, set.error().what);
}

/// The names that programs with OpenCV's matrices give them. PhotonVision wrote the distortion as
/// `cameraExtrinsics` for years.
constexpr std::array<const char*, 5> kMatrixKeys{"camera_matrix", "Camera_Matrix",
                                                 "cameraIntrinsics", "cameraMatrix", "K"};
constexpr std::array<const char*, 8> kDistortionKeys{"distortion_coefficients",
                                                     "Distortion_Coefficients",
                                                     "distCoeffs",
                                                     "cameraExtrinsics",
                                                     "dist_k1k2p1p2k3",
                                                     "dist_coeffs",
                                                     "dist_coeff",
                                                     "D"};
constexpr std::array<std::array<const char*, 2>, 3> kSizeKeys{
    {{"image_width", "image_height"}, {"image_Width", "image_Height"}, {"width", "height"}}};

/// @return the first key that is there; nullptr: none
template <std::size_t N>
const char* key_of(const YamlSection& yaml, const std::array<const char*, N>& keys) {
  const auto* found = std::ranges::find_if(keys, [&](const char* key) { return yaml.has(key); });
  return found == keys.end() ? nullptr : *found;
}

// Without a name of the lens the number of coefficients decides, unless it fits two lenses.
std::string lens_of_opencv(const YamlSection& yaml) {
  if (const auto fisheye = yaml.integer("fisheye_model"))
    return *fisheye != 0 ? "fisheye" : "plumb_bob";
  return yaml.text("distortion_model").value_or("");
}

std::vector<double> size_of_opencv(const YamlSection& yaml) {
  for (const auto& [width, height] : kSizeKeys)
    if (yaml.has(width) || yaml.has(height))
      return {yaml.required_number(width), yaml.required_number(height)};
  for (const char* key : {"resolution", "img_size", "image_size"}) {
    if (!yaml.has(key)) continue;
    if (!yaml.is_map(key)) return yaml.required_numbers(key, 2);
    const YamlSection size = yaml.section(key);
    if (size.has("data")) return size.required_numbers("data", 2);
    if (size.has("width")) return {size.required_number("width"), size.required_number("height")};
    return {size.required_number("x"), size.required_number("y")};
  }
  yaml.add_fault("image_width", "is missing, and so are image_height, resolution and img_size");
  return {0, 0};
}

CameraModel read_opencv(const YamlSection& yaml, const char* matrix) {
  CameraModel model;
  set_pinhole(yaml, matrix, model);
  set_size(size_of_opencv(yaml), model);
  const char* distortion = key_of(yaml, kDistortionKeys);
  if (distortion == nullptr)
    yaml.add_fault("distortion_coefficients", "is missing");
  else
    set_lens_of(yaml, distortion, lens_of_opencv(yaml), model);
  check_model(yaml, model);
  return model;
}

/// The camera in IMU axes X_IV, or beside the camera before.
void read_place(const YamlSection& yaml, const CalibratedCamera* before, CalibratedCamera& camera) {
  if (const auto T_cam_imu = yaml.pose("T_cam_imu")) {
    camera.mount.X_BV = T_cam_imu->inverse();
    camera.place = CameraPlace::kOnBody;
  } else if (const auto T_imu_cam = yaml.pose("T_imu_cam")) {
    camera.mount.X_BV = *T_imu_cam;
    camera.place = CameraPlace::kOnBody;
  } else if (before != nullptr && yaml.has("T_cn_cnm1")) {
    const auto T_cn_cnm1 = yaml.pose("T_cn_cnm1");
    camera.mount.X_BV = before->mount.X_BV * T_cn_cnm1.value_or(Pose{}).inverse();
    camera.place =
        before->place == CameraPlace::kOnBody ? CameraPlace::kOnBody : CameraPlace::kBesideTheFirst;
  }
}

void read_time_shift(double seconds, CameraMount& mount) {
  constexpr double kLargest_s = 10;
  mount.time_shift = from_seconds(std::clamp(seconds, -kLargest_s, kLargest_s));
}

/// Kalibr's camchain, also of cameras only, and TagSLAM's cameras.yaml: cam0, cam1, …
std::vector<CalibratedCamera> read_camchain(const YamlSection& yaml, const CameraMount& otherwise) {
  std::vector<CalibratedCamera> cameras;
  for (std::size_t k = 0; yaml.has("cam" + std::to_string(k)); ++k) {
    const YamlSection section = yaml.section("cam" + std::to_string(k));
    CalibratedCamera camera{otherwise};
    camera.mount.model = read_pinhole(section, "distortion_coeffs");
    read_place(section, cameras.empty() ? nullptr : &cameras.back(), camera);
    if (const auto shift = section.number("timeshift_cam_imu"))
      read_time_shift(*shift, camera.mount);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

using Keys = std::vector<std::string>;

/// A format with a key for each number.
/// @param pinhole  keys of fu, fv, cu, cv   @param k  the section of the coefficients
/// @param coefficients  keys; those that are missing are zero
void read_named(const YamlSection& yaml, const Keys& pinhole, const std::string& lens,
                const YamlSection& k, const Keys& coefficients, CameraModel& model) {
  model.fu = yaml.required_number(pinhole[0]);
  model.fv = yaml.required_number(pinhole[1]);
  model.cu = yaml.required_number(pinhole[2]);
  model.cv = yaml.required_number(pinhole[3]);
  std::vector<double> numbers;
  for (const std::string& key : coefficients) numbers.push_back(k.number(key).value_or(0));
  if (const auto set = set_lens(model, lens, numbers); !set)
    k.add_fault(coefficients.empty() ? "" : coefficients.front(), set.error().what);
  check_model(yaml, model);
}

CameraModel read_basalt_lens(const YamlSection& camera, const std::vector<double>& size) {
  CameraModel model;
  set_size(size, model);
  const std::string type = camera.text("camera_type").value_or("");
  const YamlSection numbers = camera.section("intrinsics");
  const Keys pinhole{"fx", "fy", "cx", "cy"};
  if (type == "kb4")
    read_named(numbers, pinhole, type, numbers, {"k1", "k2", "k3", "k4"}, model);
  else if (type.starts_with("pinhole"))
    read_named(numbers, pinhole, "radtan", numbers,
               {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}, model);
  else
    camera.add_fault("camera_type", "is " + type +
                                        "; supported are pinhole, pinhole-radtan8 and kb4: "
                                        "calibrate with one of these");
  return model;
}

/// camodocal's, as VINS-Mono and VINS-Fusion read it.
CameraModel read_camodocal(const YamlSection& yaml) {
  CameraModel model;
  set_size({yaml.required_number("image_width"), yaml.required_number("image_height")}, model);
  const std::string type = yaml.text("model_type").value_or("");
  const YamlSection numbers = yaml.section("projection_parameters");
  if (type == "PINHOLE")
    read_named(numbers, {"fx", "fy", "cx", "cy"}, "radtan", yaml.section("distortion_parameters"),
               {"k1", "k2", "p1", "p2"}, model);
  else if (type == "KANNALA_BRANDT")
    read_named(numbers, {"mu", "mv", "u0", "v0"}, "kb4", numbers, {"k2", "k3", "k4", "k5"}, model);
  else
    yaml.add_fault(
        "model_type",
        "is " + type + "; supported are PINHOLE and KANNALA_BRANDT: calibrate with one of these");
  return model;
}

/// ORB-SLAM's settings, of version 2 (`Camera.fx`) or 3 (`Camera1.fx`).
CameraModel read_orb_slam(const YamlSection& yaml) {
  CameraModel model;
  set_size({yaml.required_number("Camera.width"), yaml.required_number("Camera.height")}, model);
  const std::string type = yaml.text("Camera.type").value_or("PinHole");
  const bool is_fisheye = type == "KannalaBrandt8";
  if (!is_fisheye && type != "PinHole")
    yaml.add_fault("Camera.type", "is " + type + "; supported are PinHole and KannalaBrandt8");
  const auto keys = [&](Keys all) {
    for (std::string& key : all) key.insert(0, yaml.has("Camera1.fx") ? "Camera1." : "Camera.");
    return all;
  };
  read_named(yaml, keys({"fx", "fy", "cx", "cy"}), is_fisheye ? "kb4" : "radtan", yaml,
             keys(is_fisheye ? Keys{"k1", "k2", "k3", "k4"} : Keys{"k1", "k2", "p1", "p2", "k3"}),
             model);
  return model;
}

/// mrcal's .cameramodel, a dictionary of Python: fu fv cu cv and the coefficients in one list.
CameraModel read_mrcal(const YamlSection& yaml) {
  CameraModel model;
  constexpr std::string_view kBefore = "LENSMODEL_";
  std::string name = yaml.text("lensmodel").value_or("");
  if (name.starts_with(kBefore)) name.erase(0, kBefore.size());
  set_size(yaml.required_numbers("imagersize", 2), model);
  const std::vector<double> numbers = yaml.numbers("intrinsics");
  if (numbers.size() < 4) {
    yaml.add_fault("intrinsics", "must be fu, fv, cu, cv and the coefficients");
    return model;
  }
  std::tie(model.fu, model.fv, model.cu, model.cv) =
      std::tie(numbers[0], numbers[1], numbers[2], numbers[3]);
  if (const auto set = set_lens(model, name, std::span(numbers).subspan(4)); !set)
    yaml.add_fault("lensmodel", set.error().what);
  check_model(yaml, model);
  return model;
}

/// Basalt's calibration.json.
std::vector<CalibratedCamera> read_basalt(const YamlSection& yaml, const CameraMount& otherwise) {
  std::vector<CalibratedCamera> cameras;
  const auto places = yaml.sections("T_imu_cam");
  const auto lenses = yaml.sections("intrinsics");
  const std::vector<double> sizes = yaml.numbers("resolution");
  if (places.size() != lenses.size() || sizes.size() != 2 * lenses.size()) {
    yaml.add_fault("resolution", "must have as many entries as intrinsics and T_imu_cam");
    return cameras;
  }
  for (std::size_t k = 0; k < lenses.size(); ++k) {
    CalibratedCamera camera{otherwise, CameraPlace::kOnBody};
    camera.mount.model = read_basalt_lens(lenses[k], {sizes[2 * k], sizes[2 * k + 1]});
    const auto number = [&](const char* key) { return places[k].required_number(key); };
    Eigen::Quaterniond q(number("qw"), number("qx"), number("qy"), number("qz"));
    if (!(std::abs(q.norm() - 1) < 1e-3))
      places[k].add_fault("qw", "is of no unit quaternion");
    else
      camera.mount.X_BV = {q.normalized(), {number("px"), number("py"), number("pz")}};
    read_time_shift(1e-9 * yaml.number("cam_time_offset_ns").value_or(0), camera.mount);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

/// A file of one camera. @return false: its format is not known
bool read_single(const YamlSection& yaml, CameraModel& model) {
  const char* matrix = key_of(yaml, kMatrixKeys);
  if (yaml.has("intrinsics") && yaml.has("resolution"))
    model = read_pinhole(yaml, "distortion_coefficients");
  else if (matrix != nullptr)
    model = read_opencv(yaml, matrix);
  else if (yaml.has("projection_parameters") || yaml.has("mirror_parameters"))
    model = read_camodocal(yaml);
  else if (yaml.has("Camera.fx") || yaml.has("Camera1.fx"))
    model = read_orb_slam(yaml);
  else if (yaml.has("lensmodel"))
    model = read_mrcal(yaml);
  else
    return false;
  return true;
}

/// PhotonVision's lenses of one camera for several modes, COLMAP's of unordered cameras: the one
/// for images of this size.
CameraModel read_list(const YamlSection& yaml, const CameraModel& images) {
  const std::vector<YamlSection> all = yaml.sections("calibrations");
  std::vector<YamlSection> fitting;
  std::string sizes;
  for (const YamlSection& section : all) {
    CameraModel size;
    set_size(size_of_opencv(section), size);
    sizes += (sizes.empty() ? "" : ", ") + size_text(size.width, size.height);
    const bool fits = images.width == size.width && images.height == size.height;
    if (fits || images.width == 0 || all.size() == 1) fitting.push_back(section);
  }
  CameraModel model;
  if (all.empty())
    yaml.add_fault("calibrations", "has no lens: calibrate the camera first");
  else if (fitting.size() != 1)
    yaml.add_fault("calibrations",
                   "has " + std::to_string(all.size()) + " lenses (for images of " + sizes + ")" +
                       (images.width == 0 ? std::string()
                                          : ", " + std::to_string(fitting.size()) +
                                                " of them for this camera's images of " +
                                                size_text(images.width, images.height)) +
                       ": keep only the lens of this camera");
  else if (!read_single(fitting.front(), model))
    fitting.front().add_fault("camera_matrix", "is missing: this is no lens");
  return model;
}

tl::unexpected<Error> no_calibration(const std::string& path) {
  return fail(ErrorCode::kInvalid,
              "is no camera calibration: expected the keys intrinsics + resolution (EuRoC), "
              "camera_matrix + distortion_coefficients (OpenCV, ROS, WPILib, PhotonVision), "
              "cam0 (Kalibr, TagSLAM), value0 (Basalt), projection_parameters (camodocal, VINS), "
              "Camera.fx or Camera1.fx (ORB-SLAM), lensmodel (mrcal), or COLMAP's cameras.txt or "
              "DSO's camera.txt; or "
              "of an IMU's noise gyroscope_noise_density (Kalibr), gyr_n (VINS) or Gyr (imu_utils)",
              path);
}

Expected<YamlSection> load_calibration(const std::string& path) {
  constexpr std::size_t kLargest_bytes = 16 << 20;
  const auto text = read_whole_file(path, kLargest_bytes);
  if (!text) return tl::unexpected(text.error());
  const auto node = calibration_node(*text);
  const bool has_keys = !text->starts_with('[') && text->find(':') != std::string::npos;
  if (!node && !has_keys) return no_calibration(path);
  if (!node) return YamlSection::load(path);
  return YamlSection(*node, "", std::make_shared<YamlReading>(YamlReading{path}));
}

}  // namespace

CameraModel read_pinhole(const YamlSection& yaml, const std::string& coefficients_key) {
  CameraModel model;
  const std::string kind = yaml.text("camera_model").value_or("pinhole");
  if (kind != "pinhole") {
    yaml.add_fault(
        "camera_model",
        "is " + kind +
            ", only pinhole is supported (in Kalibr pinhole-radtan or pinhole-equi, in COLMAP "
            "OPENCV, FULL_OPENCV or OPENCV_FISHEYE)");
    return model;  // the numbers of another model mean something else
  }
  const std::vector<double> size = yaml.required_numbers("resolution", 2);
  const std::vector<double> pinhole = yaml.required_numbers("intrinsics", 4);
  set_size(size, model);
  std::tie(model.fu, model.fv, model.cu, model.cv) =
      std::tie(pinhole[0], pinhole[1], pinhole[2], pinhole[3]);
  const std::string lens = yaml.text("distortion_model").value_or("none");
  if (const auto set = set_lens(model, lens, yaml.numbers(coefficients_key)); !set)
    yaml.add_fault(coefficients_key, set.error().what);
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
    yaml.add_fault("intrinsics_sigma",
                   "must be >= 0, focal below 1, centre_px below 10000, k1 at most 1");
  mount.lens_error_px = yaml.number("lens_error_px").value_or(mount.lens_error_px);
  if (!(mount.lens_error_px >= 0 && mount.lens_error_px <= kLargestLensError_px))
    yaml.add_fault("lens_error_px", "must be from 0 to 10");
}

Expected<std::vector<CalibratedCamera>> read_calibration(const std::string& path,
                                                         const CameraMount& otherwise) {
  const Expected<YamlSection> yaml = load_calibration(path);
  if (!yaml) return tl::unexpected(yaml.error());
  std::vector<CalibratedCamera> cameras;
  if (yaml->has("cam0")) {
    cameras = read_camchain(*yaml, otherwise);
  } else if (yaml->has("value0")) {
    cameras = read_basalt(yaml->section("value0"), otherwise);
  } else {
    CalibratedCamera camera{otherwise};
    if (yaml->has("calibrations"))
      camera.mount.model = read_list(*yaml, otherwise.model);
    else if (!read_single(*yaml, camera.mount.model))
      return no_calibration(path);
    read_lens_sigmas(*yaml, camera.mount);
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty() && yaml->check()) return no_calibration(path);
  return yaml->check().map([&] { return std::move(cameras); });
}

Expected<CameraModel> read_camera_calibration(const std::string& path) {
  const auto cameras = read_calibration(path, {});
  if (!cameras) return tl::unexpected(cameras.error());
  if (cameras->size() == 1) return cameras->front().mount.model;
  return fail(ErrorCode::kInvalid,
              "has " + std::to_string(cameras->size()) + " cameras, expected is one", path);
}

}  // namespace fiducap
