#include "base/yaml_section.hpp"
#include "capture/lens/calibration_files.hpp"

namespace fiducap {

Expected<ImuNoise> read_imu_noise(const std::string& path) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  const bool is_imu_utils = yaml->has("Gyr") && yaml->has("Acc");
  const bool has_short_names = is_imu_utils || yaml->has("gyr_n");  // VINS
  const YamlSection imu = yaml->has("imu0") ? yaml->section("imu0") : *yaml;
  const YamlSection gyro = is_imu_utils ? yaml->section("Gyr").section("avg-axis") : imu;
  const YamlSection accel = is_imu_utils ? yaml->section("Acc").section("avg-axis") : imu;
  const auto positive = [](const YamlSection& section, const char* key) {
    const double value = section.required_number(key);
    if (section.has(key) && !(value > 0)) section.add_fault(key, "must be > 0");
    return value;
  };
  ImuNoise noise;
  noise.accel_noise_m_s2_rtHz =
      positive(accel, has_short_names ? "acc_n" : "accelerometer_noise_density");
  noise.accel_walk_m_s3_rtHz =
      positive(accel, has_short_names ? "acc_w" : "accelerometer_random_walk");
  noise.gyro_noise_rad_s_rtHz =
      positive(gyro, has_short_names ? "gyr_n" : "gyroscope_noise_density");
  noise.gyro_walk_rad_s2_rtHz = positive(gyro, has_short_names ? "gyr_w" : "gyroscope_random_walk");
  if (!has_short_names) noise.rate_hz = positive(imu, "update_rate");
  return yaml->check().map([&] { return std::move(noise); });
}

}  // namespace fiducap
