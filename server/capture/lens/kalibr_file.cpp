#include "capture/lens/kalibr_file.hpp"

#include <algorithm>

#include "base/yaml_section.hpp"
#include "capture/lens/pinhole_yaml.hpp"

namespace fiducap {
namespace {

// X_IV: the camera in IMU axes, from whichever of the equivalent statements the file makes.
Pose read_extrinsics(const YamlSection& yaml, const std::optional<Pose>& X_IV_before) {
  if (const auto T_cam_imu = yaml.pose("T_cam_imu")) return T_cam_imu->inverse();
  if (const auto T_imu_cam = yaml.pose("T_imu_cam")) return *T_imu_cam;
  if (X_IV_before) {
    if (const auto T_cn_cnm1 = yaml.pose("T_cn_cnm1")) return *X_IV_before * T_cn_cnm1->inverse();
  }
  if (!yaml.has("T_cam_imu") && !yaml.has("T_imu_cam")) {
    yaml.complain(
        "T_cam_imu",
        "is missing, and so is T_imu_cam: the result of Kalibr's camera-IMU calibration is needed "
        "(camchain-imucam), a camera-only camchain does not say where the IMU is");
  }
  return {};
}

}  // namespace

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
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  return mounts;
}

Expected<ImuNoise> read_kalibr_imu(const std::string& path) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  const YamlSection imu = yaml->has("imu0") ? yaml->section("imu0") : *yaml;
  const auto positive = [&imu](const char* key) {
    const double value = imu.required_number(key);
    if (imu.has(key) && !(value > 0)) imu.complain(key, "must be > 0");
    return value;
  };
  ImuNoise noise;
  noise.accel_noise_m_s2_rtHz = positive("accelerometer_noise_density");
  noise.accel_walk_m_s3_rtHz = positive("accelerometer_random_walk");
  noise.gyro_noise_rad_s_rtHz = positive("gyroscope_noise_density");
  noise.gyro_walk_rad_s2_rtHz = positive("gyroscope_random_walk");
  noise.rate_hz = positive("update_rate");
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  return noise;
}

}  // namespace fiducap
