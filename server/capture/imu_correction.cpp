#include "capture/imu_correction.hpp"

#include <Eigen/LU>

#include "base/text.hpp"
#include "base/yaml_section.hpp"
#include "capture/imu_sample.hpp"

namespace fiducap {
namespace {

// A unit that is further off than this is broken, or its numbers are in other units.
constexpr double kMostOff = 0.5;
constexpr double kMostAccelBias_m_s2 = 5;
constexpr double kMostGyroBias_rad_s = 1;

Eigen::Matrix3d matrix_from(const std::vector<double>& numbers) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
}

std::string list_of(const Eigen::Vector3d& v) {
  return "[" + shortest(v.x()) + ", " + shortest(v.y()) + ", " + shortest(v.z()) + "]";
}

std::string rows_of(const Eigen::Matrix3d& M) {
  std::string text = "[";
  for (int row = 0; row < 3; ++row)
    text += (row == 0 ? "" : ", ") + list_of(Eigen::Vector3d(M.row(row).transpose()));
  return text + "]";
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
         list_of(correction.accel_bias_m_s2) +
         "\n  accel_matrix: " + rows_of(correction.accel_matrix) +
         "\n  gyro_bias_rad_s: " + list_of(correction.gyro_bias_rad_s) +
         "\n  gyro_matrix: " + rows_of(correction.gyro_matrix) + "\n";
}

}  // namespace fiducap
