#include "capture/import/import_parts.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>

#include "base/expected.hpp"
#include "base/gravity.hpp"
#include "base/numeric.hpp"
#include "base/text.hpp"
#include "capture/import/imu_csv.hpp"
#include "capture/import/input_file.hpp"
#include "capture/reading_pairs.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostPhoneRows = 20'000'000;

/// A folder that the destructor removes.
class TemporaryDirectory final {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<TemporaryDirectory>> make() {
    std::error_code error;
    std::string name =
        (std::filesystem::temp_directory_path(error) / "fiducap-import-XXXXXX").string();
    if (error || ::mkdtemp(name.data()) == nullptr)
      return fail(ErrorCode::kUnavailable, "cannot be created for unpacking", name);
    return std::make_unique<TemporaryDirectory>(name);
  }
  explicit TemporaryDirectory(std::filesystem::path path) : path_(std::move(path)) {}
  ~TemporaryDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Columns are found by name: their order differs between versions of the app.
Expected<std::vector<VectorReading>> read_vectors(const std::string& path, FoundStream& found) {
  const auto line = first_line(path);
  if (!line) return tl::unexpected(line.error());
  const std::vector<std::string> header = split_header(*line);
  std::array<std::size_t, 4> at{};
  constexpr std::array<const char*, 4> kNames{"time", "x", "y", "z"};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto column = std::ranges::find(header, kNames[i]);
    if (column == header.end())
      return fail(ErrorCode::kNotFound, std::string("has no column '") + kNames[i] + "'", path);
    at[i] = static_cast<std::size_t>(column - header.begin());
  }
  auto rows = CsvReader::open(path);
  if (!rows) return tl::unexpected(rows.error());
  std::vector<VectorReading> readings;
  while (rows->next() && rows->line_is_complete() && readings.size() < kMostPhoneRows) {
    const auto fields = rows->fields();
    VectorReading reading;
    const bool whole = fields.size() > *std::ranges::max_element(at) &&
                       parse_time(fields[at[0]], 0, reading.stamp_ns) &&
                       parse_number(fields[at[1]], reading.value[0]) &&
                       parse_number(fields[at[2]], reading.value[1]) &&
                       parse_number(fields[at[3]], reading.value[2]) && reading.stamp_ns > 0 &&
                       reading.value.allFinite();
    if (whole)
      readings.push_back(reading);
    else if (rows->line() > 1 && found.unreadable++ == 0)
      found.first_fault = std::filesystem::path(path).filename().string() + ": line " +
                          std::to_string(rows->line()) + " lacks time, x, y or z";
  }
  found.backwards += put_in_order(readings);
  return readings;
}

/// Values of Metadata.csv by name; empty without the file.
std::map<std::string, std::string> read_metadata(const std::filesystem::path& path) {
  std::map<std::string, std::string> all;
  const auto line = is_file(path) ? first_line(path.string()) : Expected<std::string>("");
  auto rows = CsvReader::open(path);
  if (!line || !rows || !rows->next() || !rows->next()) return all;
  const std::vector<std::string> names = split_header(*line);
  for (std::size_t i = 0; i < std::min(names.size(), rows->fields().size()); ++i)
    all[names[i]] = split_header(rows->fields()[i]).front();
  return all;
}

/// Of the rear camera, images not rotated: image x points down the phone, image y to its left.
Pose camera_of_a_phone() {
  Eigen::Matrix3d R_BV;
  R_BV << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  return {Eigen::Quaterniond(R_BV), Eigen::Vector3d::Zero()};
}

class SensorLogger final : public PartsImport {
 public:
  SensorLogger(std::filesystem::path folder, std::unique_ptr<TemporaryDirectory> unpacked,
               const Clock& clock)
      : PartsImport(&clock),
        folder_(std::move(folder)),
        unpacked_(std::move(unpacked)),
        clock_(clock) {}

  Expected<void> look(const ImportOptions& options) {
    if (const auto looked = look_at_camera(); !looked) return looked;
    return look_at_imu(options);
  }

 private:
  Expected<void> look_at_imu(const ImportOptions& options) {
    FoundStream found;
    found.kind = FoundKind::kImu;
    found.name = has("GyroscopeUncalibrated.csv") ? "GyroscopeUncalibrated.csv" : "Gyroscope.csv";
    found.type = "Sensor Logger";
    const auto gyro = read_vectors(file(found.name.c_str()), found);
    if (!gyro) return tl::unexpected(gyro.error());
    auto force = specific_force(found);
    if (!force) return tl::unexpected(force.error());
    if (force->empty())
      return fail(ErrorCode::kInvalid, "has no accelerometer readings", folder_.string());
    const auto metadata = read_metadata(folder_ / "Metadata.csv");
    const auto value_of = [&](const char* key) {
      const auto value = metadata.find(key);
      return value == metadata.end() ? std::string() : value->second;
    };
    std::vector<double> sizes;
    for (const VectorReading& f : *force) sizes.push_back(f.value.norm());
    double factor = nth_smallest(sizes, sizes.size() / 2) < 2 ? kStandardGravity_m_s2 : 1.0;
    if (factor != 1.0) remarks_.emplace_back("its unit is g");
    const bool turned = value_of("platform") == "ios" && value_of("standardisation") != "true";
    if (turned) {
      factor = -factor;
      remarks_.emplace_back(
          "iOS without standardised frames: the sign of specific force is inverted");
    }
    if (metadata.empty())
      remarks_.emplace_back("no Metadata.csv: Android's signs (or standardised ones) are assumed");
    for (VectorReading& f : *force) f.value *= factor;
    ImuPairs pairs = pair_readings(*gyro, *force);
    remarks_.push_back("the accelerometer is interpolated at the times of the gyro" +
                       (pairs.alone == 0 ? std::string()
                                         : "; " + std::to_string(pairs.alone) +
                                               " gyro readings without one are left out"));
    if (pairs.samples.empty())
      return fail(ErrorCode::kInvalid, "gyro and accelerometer have no time in common",
                  folder_.string());
    for (ImuSample& sample : pairs.samples) sample.sampled_at += options.imu_offset;
    found.count = pairs.samples.size();
    found.first_ns = to_ns(pairs.samples.front().sampled_at);
    found.last_ns = to_ns(pairs.samples.back().sampled_at);
    add_imu(std::move(found), std::move(pairs.samples));
    return {};
  }

  Expected<std::vector<VectorReading>> specific_force(FoundStream& found) {
    for (const char* name : {"TotalAcceleration.csv", "AccelerometerUncalibrated.csv"}) {
      if (!has(name)) continue;
      remarks_.push_back(std::string("specific force is ") + name);
      return read_vectors(file(name), found);
    }
    if (has("Accelerometer.csv") && has("Gravity.csv")) return with_gravity(found);
    return fail(ErrorCode::kNotFound,
                "has no specific force: TotalAcceleration.csv, AccelerometerUncalibrated.csv, or "
                "Accelerometer.csv (without gravity) together with Gravity.csv is needed; switch "
                "them on in the app",
                folder_.string());
  }

  /// Acceleration without gravity, plus gravity, as separated by the phone.
  Expected<std::vector<VectorReading>> with_gravity(FoundStream& found) {
    auto moved = read_vectors(file("Accelerometer.csv"), found);
    if (!moved) return moved;
    const auto gravity = read_vectors(file("Gravity.csv"), found);
    if (!gravity) return gravity;
    const ImuPairs pairs = pair_readings(*moved, *gravity);
    std::vector<VectorReading> force;
    force.reserve(pairs.samples.size());
    for (const ImuSample& pair : pairs.samples)
      force.push_back({to_ns(pair.sampled_at), pair.w_WB_B + pair.f_B});
    remarks_.emplace_back(
        "specific force is Accelerometer.csv + Gravity.csv, as separated by the phone");
    return force;
  }

  Expected<void> look_at_camera() {
    const std::filesystem::path folder = folder_ / "Camera";
    Camera pictures;
    std::vector<Camera> videos;
    for (ListedImage& image : pictures_by_time(folder.string(), 6)) {
      const std::string ending = std::filesystem::path(image.file).extension().string();
      if (ending == ".mp4" || ending == ".mov")
        videos.push_back({{}, image.file, Duration(image.ns)});
      else if (ending == ".jpg" || ending == ".jpeg" || ending == ".png")
        pictures.files.push_back(std::move(image));
    }
    for (Camera& video : videos) {
      auto found = look_at_video(video.video, clock_);
      if (!found) return tl::unexpected(found.error());
      found->name = "Camera/" + found->name;
      found->first_ns = video.begins.count();
      add_phone_camera(std::move(*found), std::move(video));
      remarks_.emplace_back(
          "the video begins at the time in its name, which is that of the start button: its images "
          "are later by the delay of the phone (0.1 to 0.7 s). Compensate that by a negative "
          "--imu-offset, e.g. --imu-offset -0.4");
    }
    if (pictures.files.empty()) return {};
    auto found = stream_of("Camera", pictures.files);
    if (!found) return tl::unexpected(found.error());
    add_phone_camera(std::move(*found), std::move(pictures));
    return {};
  }

  void add_phone_camera(FoundStream found, Camera camera) {
    found.lens_fault = "the app does not record the lens";
    found.mount.X_BV = camera_of_a_phone();
    // Between phone and camera.
    found.mount.position_sigma_m = 0.05;
    found.mount.rotation_sigma_rad = 2 * kDegree;
    found.mount.time_shift_sigma_s = 0.05;
    found.place = CameraPlace::kOnBody;
    add_camera(std::move(found), std::move(camera));
  }

  [[nodiscard]] std::string file(const char* name) const { return (folder_ / name).string(); }
  /// The app writes an empty file for a sensor that was switched on without readings.
  [[nodiscard]] bool has(const char* name) const {
    std::error_code error;
    return is_file(folder_ / name) && std::filesystem::file_size(folder_ / name, error) > 0;
  }

  std::filesystem::path folder_;
  std::unique_ptr<TemporaryDirectory> unpacked_;
  const Clock& clock_;
};

/// Unpacks only files that are read, under known names.
Expected<std::unique_ptr<TemporaryDirectory>> unpack_log(const std::string& path) {
  auto archive = ZipArchive::open(path);
  if (!archive) return tl::unexpected(archive.error());
  auto folder = TemporaryDirectory::make();
  if (!folder) return folder;
  constexpr std::array<const char*, 7> kTables{
      "Gyroscope.csv",         "GyroscopeUncalibrated.csv",
      "Accelerometer.csv",     "AccelerometerUncalibrated.csv",
      "TotalAcceleration.csv", "Gravity.csv",
      "Metadata.csv"};
  bool any = false;
  for (const ZipEntry& entry : archive->entries()) {
    const std::filesystem::path name(entry.name);
    const std::string last = name.filename().string();
    std::int64_t number = 0;
    const bool is_table = std::find(kTables.begin(), kTables.end(), last) != kTables.end();
    const bool is_image =
        name.parent_path().filename() == "Camera" && parse_number(name.stem().string(), number);
    if ((!is_table && !is_image) || last.empty()) continue;
    any = any || last == "Gyroscope.csv" || last == "GyroscopeUncalibrated.csv";
    const auto to = (is_image ? (*folder)->path() / "Camera" : (*folder)->path()) / last;
    if (is_file(to)) continue;
    if (const auto unpacked = archive->unpack(entry, to); !unpacked)
      return tl::unexpected(unpacked.error());
  }
  if (any) return folder;
  return fail(ErrorCode::kUnsupported,
              "is a ZIP archive, but not one of Sensor Logger: it has no Gyroscope.csv", path);
}

}  // namespace

bool is_sensor_logger_folder(const std::string& path) {
  const std::filesystem::path folder(path);
  return is_file(folder / "Gyroscope.csv") || is_file(folder / "GyroscopeUncalibrated.csv");
}

OpenedImport open_sensor_logger(const std::string& path, const ImportOptions& options) {
  FIDUCAP_ASSERT(options.clock != nullptr);
  std::filesystem::path folder(path);
  std::unique_ptr<TemporaryDirectory> unpacked;
  if (!is_folder(folder)) {
    auto made = unpack_log(path);
    if (!made) return tl::unexpected(made.error());
    unpacked = std::move(*made);
    folder = unpacked->path();
  }
  auto source =
      std::make_unique<SensorLogger>(std::move(folder), std::move(unpacked), *options.clock);
  return source->look(options).map([&] { return std::move(source); });
}

}  // namespace fiducap
