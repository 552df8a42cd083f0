#include "capture/lens/calibration_files.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>

#include "base/yaml_section.hpp"

namespace fiducap {
namespace {

/// The first name of each model is the one that is written.
constexpr std::array<std::pair<std::string_view, Distortion>, 7> kNames{
    {{"none", Distortion::kNone},
     {"radial-tangential", Distortion::kRadialTangential},
     {"radtan", Distortion::kRadialTangential},
     {"plumb_bob", Distortion::kRadialTangential},
     {"equidistant", Distortion::kEquidistant},
     {"equi", Distortion::kEquidistant},
     {"fisheye", Distortion::kEquidistant}}};

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

// Without a name of the lens the number of coefficients decides, unless it fits two lenses.
std::string lens_of_opencv(const YamlSection& yaml) {
  if (const auto name = yaml.text("distortion_model"))
    return *name == "rational_polynomial" ? "plumb_bob" : *name;
  if (const auto fisheye = yaml.integer("fisheye_model"))
    return *fisheye != 0 ? "fisheye" : "plumb_bob";
  if (yaml.numbers("distortion_coefficients").size() == 4)
    yaml.add_fault(
        "distortion_coefficients",
        "has 4 numbers without a distortion_model: add distortion_model: plumb_bob or equidistant");
  return "plumb_bob";
}

std::vector<double> size_of_opencv(const YamlSection& yaml) {
  if (yaml.has("image_width") || yaml.has("image_height"))
    return {yaml.required_number("image_width"), yaml.required_number("image_height")};
  for (const char* key : {"resolution", "img_size", "image_size"}) {
    if (!yaml.has(key)) continue;
    if (!yaml.is_map(key)) return yaml.required_numbers(key, 2);
    const YamlSection size = yaml.section(key);
    if (size.has("width")) return {size.required_number("width"), size.required_number("height")};
    return {size.required_number("x"), size.required_number("y")};
  }
  yaml.add_fault("image_width", "is missing, and so are image_height, resolution and img_size");
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

// X_IV: the camera in IMU axes, from one of the equivalent keys.
Pose read_extrinsics(const YamlSection& yaml, const std::optional<Pose>& X_IV_before) {
  if (const auto T_cam_imu = yaml.pose("T_cam_imu")) return T_cam_imu->inverse();
  if (const auto T_imu_cam = yaml.pose("T_imu_cam")) return *T_imu_cam;
  if (X_IV_before) {
    if (const auto T_cn_cnm1 = yaml.pose("T_cn_cnm1")) return *X_IV_before * T_cn_cnm1->inverse();
  }
  if (!yaml.has("T_cam_imu") && !yaml.has("T_imu_cam"))
    yaml.add_fault("T_cam_imu",
                   "is missing, and so is T_imu_cam: the result of Kalibr's camera-IMU calibration "
                   "is needed (camchain-imucam); a camera-only camchain has no pose of the IMU");
  return {};
}

}  // namespace

Expected<void> set_lens(CameraModel& camera, const std::string& name,
                        const std::vector<double>& coefficients) {
  const auto* known =
      std::ranges::find_if(kNames, [&](const auto& entry) { return entry.first == name; });
  if (known == kNames.end())
    return fail(ErrorCode::kUnsupported,
                "distortion model " + name +
                    " is not supported; supported are none, radial-tangential (radtan, plumb_bob) "
                    "and equidistant (fisheye)");
  const Distortion kind = known->second;
  camera.distortion = kind;
  camera.coefficients = {};
  const std::size_t n = coefficients.size();
  const std::size_t most = kind == Distortion::kNone ? 0 : kind == Distortion::kEquidistant ? 4 : 5;
  const std::size_t least = std::min<std::size_t>(most, 4);
  const auto beyond = coefficients.begin() + static_cast<std::ptrdiff_t>(std::min(n, most));
  if (!std::all_of(beyond, coefficients.end(), [](double k) { return k == 0; }))
    return fail(ErrorCode::kUnsupported,
                "distortion model " + name + " has " + std::to_string(most) +
                    " coefficients here, the file has " + std::to_string(n) +
                    " (rational, thin prism and tilted lenses are not supported)");
  if (n < least)
    return fail(ErrorCode::kInvalid, "distortion model " + name + " needs " +
                                         std::to_string(least) + " coefficients, the file has " +
                                         std::to_string(n));
  std::copy(coefficients.begin(), beyond, camera.coefficients.begin());
  return {};
}

std::string name_of(Distortion distortion) {
  return std::string(std::ranges::find_if(kNames, [&](const auto& entry) {
                       return entry.second == distortion;
                     })->first);
}

CameraModel read_pinhole(const YamlSection& yaml, const std::string& coefficients_key) {
  CameraModel model;
  const std::string kind = yaml.text("camera_model").value_or("pinhole");
  if (kind != "pinhole") {
    yaml.add_fault(
        "camera_model",
        "is " + kind + ", only pinhole is supported (Kalibr: pinhole-radtan, pinhole-equi)");
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
                "is a Kalibr camchain; configure it as such, it has extrinsics as well", path);
  } else {
    return fail(ErrorCode::kInvalid,
                "is no camera calibration: expected the keys intrinsics + resolution (EuRoC), "
                "camera_matrix + distortion_coefficients (OpenCV, ROS, WPILib) or K + "
                "dist_k1k2p1p2k3",
                path);
  }
  check_model(*yaml, model);
  read_lens_sigmas(*yaml, mount);
  return yaml->check().map([&] { return std::move(mount); });
}

Expected<std::vector<CameraMount>> read_kalibr_camchain(const std::string& path) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  std::vector<CameraMount> mounts;
  std::optional<Pose> X_IV_before;
  for (std::size_t k = 0; yaml->has("cam" + std::to_string(k)); ++k) {
    const YamlSection camera = yaml->section("cam" + std::to_string(k));
    CameraMount mount;
    mount.model = read_pinhole(camera, "distortion_coeffs");
    mount.X_BV = read_extrinsics(camera, X_IV_before);
    mount.time_shift =
        from_seconds(std::clamp(camera.number("timeshift_cam_imu").value_or(0), -10.0, 10.0));
    X_IV_before = mount.X_BV;
    mounts.push_back(mount);
  }
  if (mounts.empty())
    return fail(ErrorCode::kInvalid, "is no Kalibr camchain: it has no key cam0", path);
  return yaml->check().map([&] { return std::move(mounts); });
}

Expected<ImuNoise> read_kalibr_imu(const std::string& path) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  const YamlSection imu = yaml->has("imu0") ? yaml->section("imu0") : *yaml;
  const auto positive = [&imu](const char* key) {
    const double value = imu.required_number(key);
    if (imu.has(key) && !(value > 0)) imu.add_fault(key, "must be > 0");
    return value;
  };
  ImuNoise noise;
  noise.accel_noise_m_s2_rtHz = positive("accelerometer_noise_density");
  noise.accel_walk_m_s3_rtHz = positive("accelerometer_random_walk");
  noise.gyro_noise_rad_s_rtHz = positive("gyroscope_noise_density");
  noise.gyro_walk_rad_s2_rtHz = positive("gyroscope_random_walk");
  noise.rate_hz = positive("update_rate");
  return yaml->check().map([&] { return std::move(noise); });
}

}  // namespace fiducap
