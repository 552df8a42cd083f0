#include "capture/recording/recording_yaml.hpp"

#include <locale>
#include <sstream>

#include <yaml-cpp/yaml.h>

#include "capture/lens/lens_name.hpp"

namespace fiducap {
namespace {

// A number that comes back as the same double.
std::ostringstream exact_text() {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(17);
  return out;
}

template <typename Range>
std::string list_of(const Range& values) {
  std::ostringstream out = exact_text();
  out << '[';
  bool first = true;
  for (const auto& value : values) {
    out << (first ? "" : ", ") << value;
    first = false;
  }
  out << ']';
  return out.str();
}

std::string matrix_of(const Pose& X, const std::string& indent) {
  const Eigen::Matrix3d R = X.rotation();
  std::vector<double> rows;
  for (Eigen::Index i = 0; i < 3; ++i) rows.insert(rows.end(), {R(i, 0), R(i, 1), R(i, 2), X.p(i)});
  rows.insert(rows.end(), {0, 0, 0, 1});
  return indent + "T_BS:\n" + indent + "  cols: 4\n" + indent + "  rows: 4\n" + indent +
         "  data: " + list_of(rows) + "\n";
}

}  // namespace

std::string camera_yaml(const CameraMount& mount) {
  const CameraModel& model = mount.model;
  const std::size_t coefficients = model.distortion == Distortion::kRadialTangential ? 5 : 4;
  std::ostringstream out = exact_text();
  out << "sensor_type: camera\n"
      << matrix_of(mount.X_BV, "") << "rate_hz: " << mount.rate_hz << "\n"
      << "resolution: [" << model.width << ", " << model.height << "]\n"
      << "camera_model: pinhole\n"
      << "intrinsics: " << list_of(std::array{model.fu, model.fv, model.cu, model.cv})
      << "  # fu, fv, cu, cv\n"
      << "distortion_model: " << name_of(model.distortion) << "\n"
      << "distortion_coefficients: "
      << list_of(std::vector(model.coefficients.begin(), model.coefficients.begin() + coefficients))
      << "\n"
      << "timeshift_cam_imu: " << to_seconds(mount.time_shift) << "  # s, t_imu = t_cam + shift\n"
      << "timeshift_sigma: " << mount.time_shift_sigma_s << "\n"
      << "readout: " << mount.readout_s << "  # s, rolling shutter, first row to last\n"
      << "readout_sigma: " << mount.readout_sigma_s << "\n"
      << "T_BS_sigma: {translation_m: " << mount.position_sigma_m
      << ", rotation_rad: " << mount.rotation_sigma_rad << "}\n";
  if (mount.focal_sigma > 0 || mount.centre_sigma_px > 0 || mount.k1_sigma > 0)
    out << "intrinsics_sigma: {focal: " << mount.focal_sigma
        << ", centre_px: " << mount.centre_sigma_px << ", k1: " << mount.k1_sigma << "}\n";
  if (mount.lens_error_px > 0) out << "lens_error_px: " << mount.lens_error_px << "\n";
  return out.str();
}

std::string imu_yaml(const RecordingInfo& info) {
  const ImuNoise& noise = *info.imu;
  std::ostringstream out = exact_text();
  out << "sensor_type: imu\n"
      << matrix_of(info.X_BI, "") << "rate_hz: " << noise.rate_hz << "\n"
      << "gyroscope_noise_density: " << noise.gyro_noise_rad_s_rtHz << "  # rad/s/sqrt(Hz)\n"
      << "gyroscope_random_walk: " << noise.gyro_walk_rad_s2_rtHz << "  # rad/s^2/sqrt(Hz)\n"
      << "accelerometer_noise_density: " << noise.accel_noise_m_s2_rtHz << "  # m/s^2/sqrt(Hz)\n"
      << "accelerometer_random_walk: " << noise.accel_walk_m_s3_rtHz << "  # m/s^3/sqrt(Hz)\n";
  if (info.gravity_m_s2) out << "gravity_m_s2: " << *info.gravity_m_s2 << "\n";
  if (noise.correction) out << to_imu_correction_yaml(*noise.correction, "samples are without it");
  return out.str();
}

std::string tags_yaml(const RecordingInfo& info) {
  std::ostringstream out = exact_text();
  out << "family: " << YAML::Dump(YAML::Node(info.tag_family)) << "\n"
      << "default_size_m: " << info.tag_size_m << "  # edge of the outer black border\n";
  if (info.reference_tag) out << "reference_tag: " << *info.reference_tag << "\n";
  if (info.max_hamming) out << "max_hamming: " << *info.max_hamming << "\n";
  out << "sizes_m: {";
  for (auto size = info.tag_sizes_m.begin(); size != info.tag_sizes_m.end(); ++size) {
    out << (size == info.tag_sizes_m.begin() ? "" : ", ") << size->first << ": " << size->second;
  }
  out << "}\nignore_tags: " << list_of(info.ignore_tags)
      << "\n# world_from_tag\nknown_tags:" << (info.known_tags.empty() ? " []\n" : "\n");
  for (const RecordedTag& tag : info.known_tags) {
    const auto& [q, p] = tag.X_WT;
    out << "  - {id: " << tag.tag_id << ", size_m: " << tag.edge_m
        << ", position: " << list_of(std::array{p.x(), p.y(), p.z()})
        << ", orientation_wxyz: " << list_of(std::array{q.w(), q.x(), q.y(), q.z()})
        << ", position_sigma_m: " << tag.position_sigma_m
        << ", rotation_sigma_rad: " << tag.rotation_sigma_rad << "}\n";
  }
  return out.str();
}

std::string extrinsics_yaml(const std::vector<Pose>& X_BV) {
  std::string out = "# sensor -> body\n";
  for (std::size_t k = 0; k < X_BV.size(); ++k) {
    out += "cam" + std::to_string(k) + ":\n" + matrix_of(X_BV[k], "  ");
  }
  return out;
}

}  // namespace fiducap
