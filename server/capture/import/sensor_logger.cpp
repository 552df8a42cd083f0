#include "capture/import/sensor_logger.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "base/assert.hpp"
#include "base/text.hpp"
#include "capture/import/asl_folder.hpp"
#include "capture/import/imu_columns.hpp"
#include "capture/import/imu_csv.hpp"
#include "capture/import/imu_pairs.hpp"
#include "capture/import/message_log.hpp"
#include "capture/import/parts_source.hpp"
#include "capture/import/video_import.hpp"
#include "capture/import/zip_archive.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

constexpr Duration kLongestPairGap = std::chrono::milliseconds(100);
constexpr std::int64_t kMillisecond_ns = 1'000'000;
constexpr std::size_t kMostPhoneRows = 20'000'000;

/// A folder that goes away when nobody needs it any more.
class PassingFolder final {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<PassingFolder>> make() {
    std::error_code error;
    std::string name =
        (std::filesystem::temp_directory_path(error) / "fiducap-import-XXXXXX").string();
    if (error || ::mkdtemp(name.data()) == nullptr)
      return fail(ErrorCode::kUnavailable, "cannot be made, to unpack into it", name);
    auto folder = std::make_unique<PassingFolder>();
    folder->path_ = name;
    return folder;
  }
  PassingFolder() = default;
  ~PassingFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  PassingFolder(const PassingFolder&) = delete;
  PassingFolder& operator=(const PassingFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The app writes an empty file for a sensor that was switched on and gave nothing.
bool has_content(const std::filesystem::path& file) {
  std::error_code error;
  return is_file(file) && std::filesystem::file_size(file, error) > 0;
}

/// Columns of a file of the app by their names: their order differs between versions.
Expected<std::map<std::string, std::size_t>> phone_columns(const std::string& path) {
  const auto line = first_line(path);
  if (!line) return tl::unexpected(line.error());
  std::map<std::string, std::size_t> columns;
  for (const std::string& name : split_header(*line)) columns.emplace(name, columns.size());
  return columns;
}

Expected<std::vector<VectorReading>> read_vectors(const std::string& path, FoundStream& found) {
  const auto columns = phone_columns(path);
  if (!columns) return tl::unexpected(columns.error());
  std::array<std::size_t, 4> at{};
  constexpr std::array<const char*, 4> kNames{"time", "x", "y", "z"};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto column = columns->find(kNames[i]);
    if (column == columns->end())
      return fail(ErrorCode::kNotFound, std::string("has no column '") + kNames[i] + "'", path);
    at[i] = column->second;
  }
  auto rows = CsvReader::open(path);
  if (!rows) return tl::unexpected(rows.error());
  std::vector<VectorReading> readings;
  while (rows->next() && rows->line_is_complete() && readings.size() < kMostPhoneRows) {
    const auto fields = rows->fields();
    VectorReading reading;
    const bool whole = fields.size() > *std::max_element(at.begin(), at.end()) &&
                       parse_time(fields[at[0]], 0, reading.ns) &&
                       parse(fields[at[1]], reading.v[0]) && parse(fields[at[2]], reading.v[1]) &&
                       parse(fields[at[3]], reading.v[2]) && reading.ns > 0 &&
                       reading.v.allFinite();
    if (whole)
      readings.push_back(reading);
    else if (rows->line() > 1 && found.unreadable++ == 0)
      found.first_fault = std::filesystem::path(path).filename().string() + ": line " +
                          std::to_string(rows->line()) + " has not time, x, y and z";
  }
  found.backwards += put_in_order(readings);
  return readings;
}

/// What Metadata.csv says, by name; empty where there is none.
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

class SensorLogger final : public ImportSource {
 public:
  SensorLogger(std::filesystem::path folder, std::unique_ptr<PassingFolder> unpacked,
               const Clock& clock)
      : folder_(std::move(folder)), unpacked_(std::move(unpacked)), clock_(clock) {}

  Expected<void> look(const ImportOptions& options);
  const std::vector<FoundStream>& streams() const override { return streams_; }
  std::vector<std::string> remarks() const override { return remarks_; }
  Expected<std::unique_ptr<SensorSource>> open(const ImportChoice& choice,
                                               const std::vector<CameraMount>& cameras) override;

 private:
  struct Camera {
    std::vector<ListedImage> files;
    std::string video;
    Duration begins{0};
  };
  Expected<void> look_at_imu(const ImportOptions& options);
  Expected<std::vector<VectorReading>> specific_force(FoundStream& found);
  Expected<std::vector<VectorReading>> with_gravity(FoundStream& found);
  Expected<void> look_at_camera();
  void add_camera(FoundStream found, Camera camera);
  [[nodiscard]] std::string file(const char* name) const { return (folder_ / name).string(); }
  [[nodiscard]] bool has(const char* name) const { return has_content(folder_ / name); }

  std::filesystem::path folder_;
  std::unique_ptr<PassingFolder> unpacked_;
  const Clock& clock_;
  std::vector<FoundStream> streams_;
  std::vector<Camera> cameras_;  ///< Per stream; the IMU's is empty.
  std::vector<ImuSample> imu_;
  std::vector<std::string> remarks_;
};

/// Acceleration without gravity, and gravity, as the phone tells them apart.
Expected<std::vector<VectorReading>> SensorLogger::with_gravity(FoundStream& found) {
  auto moved = read_vectors(file("Accelerometer.csv"), found);
  if (!moved) return moved;
  const auto gravity = read_vectors(file("Gravity.csv"), found);
  if (!gravity) return gravity;
  const ImuPairs pairs = pair_readings(*moved, *gravity, kLongestPairGap);
  std::vector<VectorReading> force;
  force.reserve(pairs.samples.size());
  for (const ImuSample& pair : pairs.samples)
    force.push_back({to_ns(pair.sampled_at), pair.w_WB_B + pair.f_B});
  remarks_.emplace_back("specific force is Accelerometer.csv + Gravity.csv, as the phone split it");
  return force;
}

Expected<std::vector<VectorReading>> SensorLogger::specific_force(FoundStream& found) {
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

Expected<void> SensorLogger::look_at_imu(const ImportOptions& options) {
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
  const auto says = [&](const char* key) {
    const auto value = metadata.find(key);
    return value == metadata.end() ? std::string() : value->second;
  };
  std::vector<double> sizes;
  for (const VectorReading& f : *force) sizes.push_back(f.v.norm());
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2),
                   sizes.end());
  double factor = sizes[sizes.size() / 2] < 2 ? kStandardGravity_m_s2 : 1.0;
  if (factor != 1.0) remarks_.emplace_back("its unit is g");
  const bool turned = says("platform") == "ios" && says("standardisation") != "true";
  if (turned) factor = -factor;
  if (turned)
    remarks_.emplace_back("iOS without standardised frames: the sign of specific force is turned");
  if (metadata.empty())
    remarks_.emplace_back("no Metadata.csv: taken for Android's signs (or standardised ones)");
  for (VectorReading& f : *force) f.v *= factor;
  ImuPairs pairs = pair_readings(*gyro, *force, kLongestPairGap);
  remarks_.push_back("the accelerometer is interpolated at the times of the gyro" +
                     (pairs.alone == 0 ? std::string()
                                       : "; " + std::to_string(pairs.alone) +
                                             " gyro readings without one are left out"));
  if (pairs.samples.empty())
    return fail(ErrorCode::kInvalid, "gyro and accelerometer have no time in common",
                folder_.string());
  imu_ = std::move(pairs.samples);
  for (ImuSample& sample : imu_) sample.sampled_at += options.imu_offset;
  found.count = imu_.size();
  found.first_ns = to_ns(imu_.front().sampled_at);
  found.last_ns = to_ns(imu_.back().sampled_at);
  streams_.push_back(std::move(found));
  cameras_.emplace_back();
  return {};
}

/// Of the camera on the back, pictures not turned: image x runs down the phone, image y to its
/// left.
Pose camera_of_a_phone() {
  Eigen::Matrix3d R_BV;
  R_BV << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  return {Eigen::Quaterniond(R_BV), Eigen::Vector3d::Zero()};
}

void SensorLogger::add_camera(FoundStream found, Camera camera) {
  found.lens_fault = "the app does not tell the lens";
  found.mount.X_BV = camera_of_a_phone();
  // From the middle of the phone to its camera, and between their axes.
  found.mount.position_sigma_m = 0.05;
  found.mount.rotation_sigma_rad = 2 * std::numbers::pi / 180;
  found.mount.time_shift_sigma_s = 0.05;
  found.place_known = true;
  streams_.push_back(std::move(found));
  cameras_.push_back(std::move(camera));
}

Expected<void> SensorLogger::look_at_camera() {
  const std::filesystem::path folder = folder_ / "Camera";
  Camera pictures;
  std::vector<Camera> videos;
  for (ListedImage& image : pictures_by_number(folder.string(), kMillisecond_ns)) {
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
    add_camera(std::move(*found), std::move(video));
    remarks_.emplace_back(
        "the video begins at the time in its name, which is when the app was told to start: its "
        "images are later by what the phone needed (0.1 to 0.7 s). Give --imu-offset minus that, "
        "e.g. --imu-offset -0.4");
  }
  if (pictures.files.empty()) return {};
  const auto size = size_of_first(pictures.files);
  if (!size) return tl::unexpected(size.error());
  FoundStream found;
  found.name = "Camera";
  found.type = "pictures";
  found.mount.model = *size;
  found.count = pictures.files.size();
  found.first_ns = pictures.files.front().ns;
  found.last_ns = pictures.files.back().ns;
  add_camera(std::move(found), std::move(pictures));
  return {};
}

Expected<void> SensorLogger::look(const ImportOptions& options) {
  if (const auto looked = look_at_camera(); !looked) return looked;
  return look_at_imu(options);
}

Expected<std::unique_ptr<SensorSource>> SensorLogger::open(
    const ImportChoice& choice, const std::vector<CameraMount>& cameras) {
  std::vector<CameraPart> parts;
  for (std::size_t k = 0; k < choice.images.size(); ++k) {
    const Camera& camera = cameras_[choice.images[k]];
    CameraPart part{camera.files, nullptr, camera.begins};
    if (!camera.video.empty()) {
      auto video = open_video_file(camera.video, cameras[k].model, clock_);
      if (!video) return tl::unexpected(video.error());
      part.source = std::move(*video);
    }
    parts.push_back(std::move(part));
  }
  return make_parts_source(choice.imu ? imu_ : std::vector<ImuSample>{}, std::move(parts), cameras);
}

/// Only what is read, under names of ours.
Expected<std::unique_ptr<PassingFolder>> unpack_log(const std::string& path) {
  auto archive = ZipArchive::open(path);
  if (!archive) return tl::unexpected(archive.error());
  auto folder = PassingFolder::make();
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
    const bool is_image = name.parent_path().filename() == "Camera" &&
                          parse(std::string_view(name.stem().string()), number);
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

Expected<std::unique_ptr<ImportSource>> open_sensor_logger(const std::string& path,
                                                           const ImportOptions& options) {
  FIDUCAP_ASSERT(options.clock != nullptr);
  std::filesystem::path folder(path);
  std::unique_ptr<PassingFolder> unpacked;
  if (!is_folder(folder)) {
    auto made = unpack_log(path);
    if (!made) return tl::unexpected(made.error());
    unpacked = std::move(*made);
    folder = unpacked->path();
  }
  auto source =
      std::make_unique<SensorLogger>(std::move(folder), std::move(unpacked), *options.clock);
  if (const auto looked = source->look(options); !looked) return tl::unexpected(looked.error());
  return source;
}

}  // namespace fiducap
