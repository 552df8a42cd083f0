#include <array>
#include <cmath>
#include <fstream>
#include <locale>
#include <sstream>

#include <yaml-cpp/yaml.h>

#include "base/log.hpp"
#include "base/yaml_section.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

constexpr double kLargestTimeShift_s = 10;

Expected<CameraMount> read_camera(const std::filesystem::path& path) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  CameraMount mount;
  mount.model = read_pinhole(*yaml, "distortion_coefficients");
  mount.X_BV = yaml->required_pose("T_BS");
  mount.rate_hz = yaml->number("rate_hz").value_or(mount.rate_hz);
  const YamlSection sigma = yaml->section("T_BS_sigma");
  mount.position_sigma_m = sigma.number("translation_m").value_or(mount.position_sigma_m);
  mount.rotation_sigma_rad = sigma.number("rotation_rad").value_or(mount.rotation_sigma_rad);
  read_lens_sigmas(*yaml, mount);
  const double shift = yaml->number("timeshift_cam_imu").value_or(0);
  if (std::abs(shift) > kLargestTimeShift_s)
    yaml->add_fault("timeshift_cam_imu", "is more than 10 s");
  mount.time_shift = from_seconds(std::clamp(shift, -kLargestTimeShift_s, kLargestTimeShift_s));
  mount.time_shift_sigma_s = yaml->number("timeshift_sigma").value_or(mount.time_shift_sigma_s);
  mount.readout_s = yaml->number("readout").value_or(mount.readout_s);
  mount.readout_sigma_s = yaml->number("readout_sigma").value_or(mount.readout_sigma_s);
  for (const auto& [key, seconds] :
       {std::pair("timeshift_sigma", mount.time_shift_sigma_s),
        std::pair("readout", mount.readout_s), std::pair("readout_sigma", mount.readout_sigma_s)}) {
    if (!(seconds >= 0 && seconds < kLargestTimeShift_s))
      yaml->add_fault(key, "must lie between 0 and 10 s");
  }
  return yaml->check().map([&] { return std::move(mount); });
}

Expected<void> read_imu(const std::filesystem::path& path, RecordingInfo& info) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  ImuNoise noise;
  const auto not_negative = [&yaml](const char* key) {
    const double value = yaml->required_number(key);
    if (value < 0) yaml->add_fault(key, "must be >= 0");
    return value;
  };
  noise.gyro_noise_rad_s_rtHz = not_negative("gyroscope_noise_density");
  noise.gyro_walk_rad_s2_rtHz = not_negative("gyroscope_random_walk");
  noise.accel_noise_m_s2_rtHz = not_negative("accelerometer_noise_density");
  noise.accel_walk_m_s3_rtHz = not_negative("accelerometer_random_walk");
  noise.rate_hz = yaml->number("rate_hz").value_or(noise.rate_hz);
  if (yaml->has("imu_correction")) {
    const auto correction = read_imu_correction(path.string());
    if (!correction) return tl::unexpected(correction.error());
    noise.correction = *correction;
  }
  const auto gravity_m_s2 = yaml->number("gravity_m_s2");
  if (gravity_m_s2 && !(*gravity_m_s2 > 9 && *gravity_m_s2 < 11))
    yaml->add_fault("gravity_m_s2", "must lie between 9 and 11");
  const auto X_BI = yaml->pose("T_BS");
  if (const auto sound = yaml->check(); !sound) return sound;
  info.imu = noise;
  info.gravity_m_s2 = gravity_m_s2;
  info.X_BI = X_BI.value_or(Pose{});
  if (info.X_BI.p.norm() > 1e-3)
    log::warning("capture", path.string() +
                                ": the IMU is not in the origin of the body axes (T_BS); its "
                                "samples are rotated into body axes, but the lever arm is ignored");
  return {};
}

RecordedTag read_known_tag(const YamlSection& yaml, double default_size_m) {
  RecordedTag tag;
  tag.tag_id = yaml.required_integer("id");
  tag.edge_m = yaml.number("size_m").value_or(default_size_m);
  const std::vector<double> p = yaml.required_numbers("position", 3);
  const std::vector<double> q = yaml.required_numbers("orientation_wxyz", 4);
  const Eigen::Quaterniond q_WT(q[0], q[1], q[2], q[3]);
  if (std::abs(q_WT.norm() - 1) > 1e-2) {
    yaml.add_fault("orientation_wxyz", "is not a unit quaternion");
  } else {
    tag.X_WT = {q_WT.normalized(), {p[0], p[1], p[2]}};
  }
  tag.position_sigma_m = yaml.number("position_sigma_m").value_or(0);
  tag.rotation_sigma_rad = yaml.number("rotation_sigma_rad").value_or(0);
  if (tag.edge_m <= 0) yaml.add_fault("size_m", "must be > 0");
  if (tag.position_sigma_m < 0) yaml.add_fault("position_sigma_m", "must be >= 0");
  if (tag.rotation_sigma_rad < 0) yaml.add_fault("rotation_sigma_rad", "must be >= 0");
  return tag;
}

// Keys of other programs (planes, boards, comments) are ignored.
Expected<void> read_tags(const std::filesystem::path& path, RecordingInfo& info) {
  const Expected<YamlSection> yaml = YamlSection::load(path);
  if (!yaml) return tl::unexpected(yaml.error());
  info.tag_family = yaml->text("family").value_or(info.tag_family);
  info.tag_size_m = yaml->number("default_size_m").value_or(info.tag_size_m);
  if (info.tag_size_m <= 0) yaml->add_fault("default_size_m", "must be > 0");
  if (yaml->has("sizes_m")) yaml->read("sizes_m", info.tag_sizes_m);
  for (const auto& [id, size_m] : info.tag_sizes_m)
    if (!(size_m > 0)) yaml->add_fault("sizes_m", "of tag " + std::to_string(id) + " must be > 0");
  if (yaml->has("ignore_tags")) yaml->read("ignore_tags", info.ignore_tags);
  info.max_hamming = yaml->integer("max_hamming");
  info.reference_tag = yaml->integer("reference_tag");
  for (const YamlSection& known : yaml->sections("known_tags"))
    info.known_tags.push_back(read_known_tag(known, info.tag_size_m));
  return yaml->check();
}

void read_cameras(const RecordingLayout& layout, RecordingInfo& info, std::vector<Error>& faults) {
  for (std::size_t k = 0; is_folder(layout.camera(k)); ++k) {
    const Expected<CameraMount> mount = read_camera(layout.camera_yaml(k));
    if (!mount) faults.push_back(mount.error());
    info.cameras.push_back(mount.value_or(CameraMount{}));
    info.has_images.push_back(is_file(layout.images_csv(k)) && is_folder(layout.images(k)));
    info.has_corners.push_back(is_file(layout.corners_csv(k)));
  }
}

// Numbers read back as the same double.
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

std::string log_kind(const std::filesystem::path& path) {
  if (is_folder(path)) {
    if (is_file(path / "metadata.yaml")) return "a folder of rosbag2";
    return is_file(path / "Gyroscope.csv") ? "a folder of Sensor Logger" : "";
  }
  constexpr std::array<std::pair<std::string_view, const char*>, 4> kHeads{
      {{"#ROSBAG", "a bag of ROS 1"},
       {"\x89MCAP", "an MCAP file"},
       {"SQLite format 3", "a file of rosbag2"},
       {"PK\x03\x04", kZipArchive}}};
  std::array<char, 16> head{};
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), head.size());
  const std::string_view bytes(head.data(), static_cast<std::size_t>(file.gcount()));
  for (const auto& [begins, kind] : kHeads)
    if (bytes.starts_with(begins)) return kind;
  return "";
}

Expected<RecordingLayout> RecordingLayout::find(const std::filesystem::path& folder) {
  if (is_folder(folder / "mav0")) return RecordingLayout(folder);
  if (const std::string kind = log_kind(folder); !kind.empty())
    return fail(ErrorCode::kInvalid,
                "is " + kind + ", expected is the folder of a recording: `fiducap import " +
                    folder.string() + " --out " + folder.stem().string() + "_recording` makes one",
                folder.string());
  if (is_file(folder))
    return fail(ErrorCode::kInvalid,
                "is a file, expected is the folder of a recording (with mav0); `fiducap import` "
                "makes one of a bag, an MCAP file, a video or a log of a phone",
                folder.string());
  if (!is_folder(folder)) return fail(ErrorCode::kNotFound, "no such folder", folder.string());
  std::error_code ignored;
  const std::filesystem::path full = std::filesystem::weakly_canonical(folder, ignored);
  if (full.filename() == "mav0") return RecordingLayout(full.parent_path());
  std::string inside;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
    if (is_folder(entry.path() / "mav0")) inside = "; " + entry.path().string() + " has one";
  return fail(ErrorCode::kNotFound,
              "is not a recording in the EuRoC layout: it has no folder mav0" + inside,
              folder.string());
}

RecordingInfo read_recording_parts(const RecordingLayout& layout, std::vector<Error>& faults) {
  const auto note = [&faults](const Expected<void>& read) {
    if (!read) faults.push_back(read.error());
  };
  RecordingInfo info;
  info.folder = layout.folder().string();
  std::error_code ignored;
  const std::filesystem::path full = std::filesystem::weakly_canonical(layout.folder(), ignored);
  info.name = (full.has_filename() ? full : full.parent_path()).filename().string();
  read_cameras(layout, info, faults);
  if (is_file(layout.imu_csv())) note(read_imu(layout.imu_yaml(), info));
  if (is_file(layout.tags_yaml())) {
    RecordingInfo with_tags = info;
    const auto read = read_tags(layout.tags_yaml(), with_tags);
    note(read);
    if (read) info = std::move(with_tags);
  }
  if (info.imu) return info;  // odometry is not needed
  auto odometry = read_odometry(layout);
  if (odometry && *odometry)
    info.odometry = std::make_shared<const Odometry>(std::move(**odometry));
  note(odometry.map([](const auto&) {}));
  return info;
}

Expected<RecordingInfo> read_recording_info(const std::string& folder) {
  const Expected<RecordingLayout> layout = RecordingLayout::find(folder);
  if (!layout) return tl::unexpected(layout.error());
  std::vector<Error> faults;
  RecordingInfo info = read_recording_parts(*layout, faults);
  info.folder = folder;
  if (!faults.empty()) return tl::unexpected(faults.front());
  for (std::size_t k = 0; k < info.cameras.size(); ++k)
    if (is_folder(layout->images(k)) && !is_file(layout->images_csv(k)))
      log::warning("capture", layout->images(k).string() +
                                  " is not used: " + layout->images_csv(k).string() +
                                  " with the times of its images is missing");
  if (!info.cameras.empty()) return info;
  return fail(ErrorCode::kNotFound, "no camera: cam0/sensor.yaml is missing",
              layout->mav().string());
}

std::string camera_yaml(const CameraMount& mount) {
  const CameraModel& model = mount.model;
  std::ostringstream out = exact_text();
  out << "sensor_type: camera\n"
      << matrix_of(mount.X_BV, "") << "rate_hz: " << mount.rate_hz << "\n"
      << "resolution: [" << model.width << ", " << model.height << "]\n"
      << "camera_model: pinhole\n"
      << "intrinsics: " << list_of(std::array{model.fu, model.fv, model.cu, model.cv})
      << "  # fu, fv, cu, cv\n"
      << "distortion_model: " << name_of(model.distortion) << "\n"
      << "distortion_coefficients: " << list_of(listed_coefficients(model)) << "\n"
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
  for (auto size = info.tag_sizes_m.begin(); size != info.tag_sizes_m.end(); ++size)
    out << (size == info.tag_sizes_m.begin() ? "" : ", ") << size->first << ": " << size->second;
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
  for (std::size_t k = 0; k < X_BV.size(); ++k)
    out += "cam" + std::to_string(k) + ":\n" + matrix_of(X_BV[k], "  ");
  return out;
}

}  // namespace fiducap
