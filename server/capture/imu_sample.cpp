#include "capture/imu_sample.hpp"

#include <array>
#include <cctype>
#include <numbers>

#include "base/gravity.hpp"
#include "base/numeric.hpp"
#include "base/text.hpp"
#include "base/yaml_section.hpp"

namespace fiducap {
namespace {

// Larger errors mean a broken IMU or other units.
constexpr double kMostOff = 0.5;
constexpr double kMostAccelBias_m_s2 = 5;
constexpr double kMostGyroBias_rad_s = 1;

Eigen::Matrix3d matrix_from(const std::vector<double>& numbers) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
}

std::string rows_of(const Eigen::Matrix3d& M) {
  const auto row = [&M](int i) { return text_of(Eigen::Vector3d(M.row(i).transpose())); };
  return "[" + row(0) + ", " + row(1) + ", " + row(2) + "]";
}

// A mounted part is noisier than its data sheet: vibration, temperature, misalignment, aliasing.
// Two to five times is usual; this is the geometric mean.
constexpr double kMounted = 3;
// Data sheets seldom contain the random walk of the bias. The Allan deviations of white noise N and
// of a walk K cross at the minimum: N / √τ = K √(τ / 3). For consumer MEMS τ is 30 to 300 s.
constexpr double kAllanMinimum_s = 100;
constexpr double kWalkPerNoise = std::numbers::sqrt3 / kAllanMinimum_s;

/// Data sheet values: densities per √Hz, and the largest ranges that can be set. SaturationWatch
/// finds a smaller range; with too small a range here good readings would be rejected.
struct Chip {
  std::string_view name;
  double gyro_mdps;
  double accel_ug;
  double gyro_range_dps;
  double accel_range_g;
};

constexpr std::array<Chip, 19> kChips{{
    // name, gyro, accel, ranges                source
    {"adis16448", 13.5, 230, 1000, 18},  // Analog Devices, ADIS16448 rev. F, table 1
    {"adis16470", 8, 100, 2000, 40},     // Analog Devices, ADIS16470 rev. D, table 1
    {"bmi055", 14, 150, 2000, 16},       // Bosch BST-BMI055-DS000, tables 2, 3
    {"bmi085", 14, 120, 2000, 16},       // Bosch BST-BMI085-DS001; z of the accelerometer 135
    {"bmi088", 14, 175, 2000, 24},       // Bosch BST-BMI088-DS001; z of the accelerometer 190
    {"bmi160", 7, 180, 2000, 16},        // Bosch BST-BMI160-DS000, tables 2, 3
    {"bmi270", 7, 160, 2000, 16},        // Bosch BST-BMI270-DS000, performance mode
    {"bno085", 14, 150, 2000, 8},        // not published: as BNO055 (Bosch BST-BNO055-DS000)
    {"icm-20602", 4, 100, 2000, 16},     // InvenSense DS-000176, tables 1, 2
    {"icm-20608", 8, 250, 2000, 16},     // InvenSense DS-000081, tables 1, 2
    {"icm-20649", 17.5, 285, 4000, 30},  // InvenSense DS-000192, tables 1, 2
    {"icm-20689", 6, 150, 2000, 16},     // InvenSense DS-000143, tables 1, 2
    {"icm-20948", 15, 230, 2000, 16},    // InvenSense DS-000189, tables 1, 2
    {"icm-42688-p", 2.8, 70, 2000, 16},  // InvenSense DS-000347, tables 1, 2; x and y 65
    {"icm-45686", 3.8, 70, 4000, 32},    // InvenSense DS-000577, tables 1, 2
    {"lsm6dso", 3.8, 110, 2000, 16},     // ST LSM6DSO, table 2: ±16 g; 70 at ±2 g
    {"mpu-6000", 5, 400, 2000, 16},      // InvenSense PS-MPU-6000A, sections 6.1, 6.2
    {"mpu-6050", 5, 400, 2000, 16},      // the same data sheet
    {"mpu-9250", 10, 300, 2000, 16},     // InvenSense PS-MPU-9250A, tables 1, 2
}};

/// Devices that contain such a chip; of several chips the noisiest, as the one in use is unknown.
struct Carrier {
  std::string_view name;
  std::string_view chip;
};

constexpr std::array<Carrier, 17> kCarriers{{
    // Cameras; Intel's and Luxonis' hardware pages.
    {"realsense-d435i", "bmi055"},
    {"realsense-d455", "bmi055"},  // early ones; later ones have a BMI085, which is better
    {"realsense-t265", "bmi055"},
    {"oak-d", "bno085"},
    {"oak-d-lite", "bmi270"},
    {"oak-d-pro", "bno085"},  // or, by batch, a BMI270
    {"oak-d-s2", "bno085"},
    // Autopilots; the hardware pages of PX4 and ArduPilot.
    {"icm-42688", "icm-42688-p"},
    {"pixhawk-1", "mpu-6000"},
    {"pixracer", "icm-20608"},          // with an MPU-9250
    {"pixhawk-4", "bmi055"},            // with an ICM-20689
    {"pixhawk-5x", "icm-20602"},        // three of them, or ICM-42688-P
    {"pixhawk-6c", "bmi055"},           // with an ICM-42688-P
    {"pixhawk-6x", "icm-20649"},        // with ICM-42688-P and BMI088, or three ICM-45686 later
    {"cube-black", "mpu-9250"},         // with others
    {"cube-orange", "icm-20649"},       // with ICM-20602 and ICM-20948
    {"cube-orange-plus", "icm-20948"},  // with two ICM-42688-P
}};

/// Lower-case letters and digits only.
std::string plain(std::string_view name) {
  std::string text;
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

const Chip* find_chip(std::string_view part) {
  const std::string wanted = plain(part);
  for (const Chip& chip : kChips)
    if (plain(chip.name) == wanted) return &chip;
  for (const Carrier& carrier : kCarriers)
    if (plain(carrier.name) == wanted) return find_chip(carrier.chip);
  return nullptr;
}

}  // namespace

ImuSample ImuCorrection::apply(ImuSample sample) const {
  sample.w_WB_B = gyro_matrix * (sample.w_WB_B - gyro_bias_rad_s);
  sample.f_B = accel_matrix * (sample.f_B - accel_bias_m_s2);
  return sample;
}

std::vector<ConfigError> ImuCorrection::check(const std::string& prefix) const {
  Checker checker{prefix};
  const auto near_one = [&](const char* field, const Eigen::Matrix3d& M) {
    const double off = (M - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    checker.require(off <= kMostOff, field, off,
                    "must be within 0.5 of the unit matrix in every place, in SI units");
  };
  const auto small = [&](const char* field, const Eigen::Vector3d& v, double most) {
    const double largest = v.cwiseAbs().maxCoeff();
    checker.require(largest <= most, field, largest, "must be at most " + shortest(most));
  };
  near_one("accel_matrix", accel_matrix);
  near_one("gyro_matrix", gyro_matrix);
  small("accel_bias_m_s2", accel_bias_m_s2, kMostAccelBias_m_s2);
  small("gyro_bias_rad_s", gyro_bias_rad_s, kMostGyroBias_rad_s);
  return checker.errors;
}

Expected<ImuCorrection> read_imu_correction(const std::string& path) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  const YamlSection section = yaml->has("imu_correction") ? yaml->section("imu_correction") : *yaml;
  const auto vector_at = [&](const char* key) {
    return Eigen::Vector3d(section.required_numbers(key, 3).data());
  };
  ImuCorrection out;
  out.accel_bias_m_s2 = vector_at("accel_bias_m_s2");
  out.accel_matrix = matrix_from(section.required_numbers("accel_matrix", 9));
  out.gyro_bias_rad_s = vector_at("gyro_bias_rad_s");
  out.gyro_matrix = matrix_from(section.required_numbers("gyro_matrix", 9));
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  if (const auto faults = out.check("imu_correction."); !faults.empty())
    return fail(ErrorCode::kInvalid, faults.front().text(), path);
  return out;
}

std::string to_imu_correction_yaml(const ImuCorrection& correction, const std::string& heading) {
  return "# " + heading +
         "\n# corrected = matrix * (reading - bias)\nimu_correction:\n  accel_bias_m_s2: " +
         text_of(correction.accel_bias_m_s2) +
         "\n  accel_matrix: " + rows_of(correction.accel_matrix) +
         "\n  gyro_bias_rad_s: " + text_of(correction.gyro_bias_rad_s) +
         "\n  gyro_matrix: " + rows_of(correction.gyro_matrix) + "\n";
}

std::optional<ImuNoise> noise_of_part(std::string_view part, double rate_hz) {
  const Chip* chip = find_chip(part);
  if (chip == nullptr) return std::nullopt;
  ImuNoise noise;
  noise.gyro_noise_rad_s_rtHz = kMounted * chip->gyro_mdps * 1e-3 * kDegree;
  noise.accel_noise_m_s2_rtHz = kMounted * chip->accel_ug * 1e-6 * kStandardGravity_m_s2;
  noise.gyro_walk_rad_s2_rtHz = kWalkPerNoise * noise.gyro_noise_rad_s_rtHz;
  noise.accel_walk_m_s3_rtHz = kWalkPerNoise * noise.accel_noise_m_s2_rtHz;
  noise.rate_hz = rate_hz;
  noise.gyro_range_rad_s = chip->gyro_range_dps * kDegree;
  noise.accel_range_m_s2 = chip->accel_range_g * kStandardGravity_m_s2;
  return noise;
}

std::vector<std::string_view> part_names() {
  std::vector<std::string_view> names;
  for (const Chip& chip : kChips) names.push_back(chip.name);
  for (const Carrier& carrier : kCarriers) names.push_back(carrier.name);
  return names;
}

}  // namespace fiducap
