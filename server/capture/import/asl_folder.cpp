#include "capture/import/import_parts.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <initializer_list>
#include <optional>

#include "capture/import/imu_csv.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

constexpr std::array<std::string_view, 7> kEndings{".png", ".jpg", ".jpeg", ".bmp",
                                                   ".pgm", ".tif", ".tiff"};

/// Of EuRoC, or of Kalibr: cameras and IMU in the folder itself.
std::optional<RecordingLayout> asl_layout(const std::filesystem::path& path) {
  if (auto layout = RecordingLayout::find(path)) return std::move(*layout);
  for (const char* part : {"cam0", "imu0", "imu0.csv"})
    if (is_folder(path) && std::filesystem::exists(path / part)) return RecordingLayout(path, ".");
  return std::nullopt;
}

/// The first of these files that is there; else the first.
std::filesystem::path first_file(std::initializer_list<std::filesystem::path> files) {
  const auto* there = std::ranges::find_if(files, is_file);
  return there == files.end() ? *files.begin() : *there;
}

class AslImport final : public PartsImport {
 public:
  explicit AslImport(RecordingLayout layout) : PartsImport(nullptr), layout_(std::move(layout)) {}

  Expected<void> look(const ImportOptions& options) {
    std::vector<Error> faults;
    about_ = read_recording_parts(layout_, faults);
    for (std::size_t k = 0; is_folder(layout_.camera(k)); ++k)
      if (const auto looked = look_at_camera(k); !looked) return looked;
    take_calibration(faults);
    if (is_folder(layout_.detections(0)))
      remarks_.emplace_back(
          "its corners (tags0) are not imported: tags are detected in the images");
    return look_at_imu(options);
  }

  bool is_one_rig() const override { return true; }
  RecordingInfo about() const override { return about_; }
  bool has_tags() const override { return is_file(layout_.tags_yaml()); }
  Expected<std::vector<TruthSample>> truth() const override { return read_truth(layout_); }

  /// Sensors that no import reads, and truth beside the one that is taken.
  std::vector<std::string> others() const override {
    std::vector<std::string> all;
    bool has_truth = false;
    for (const auto& sensor : {layout_.state(), layout_.motion_capture(), layout_.markers()}) {
      if (is_folder(sensor) && has_truth) all.push_back(sensor.filename().string());
      has_truth = has_truth || is_file(sensor / "data.csv");
    }
    if (is_folder(layout_.mav() / "leica0"))
      all.emplace_back("leica0 (positions without attitudes)");
    if (is_file(layout_.folder() / "groundtruth.txt"))
      all.emplace_back(
          "groundtruth.txt (truth is read from mav0/mocap0/data.csv: stamp in ns, position, "
          "quaternion w x y z)");
    for (const char* other : {"pointcloud0", "imu1", "lidar0", "gps0", "baro0", "mag0"})
      if (is_folder(layout_.mav() / other)) all.emplace_back(other);
    return all;
  }

 private:
  Expected<void> look_at_camera(std::size_t k) {
    const std::string name = "cam" + std::to_string(k);
    FoundStream list;
    std::vector<ListedImage> images = listed(k, list);
    if (images.empty()) {
      images = pictures_by_time(image_folder(k).string(), -1);
      const bool is_there = is_file(layout_.images_csv(k));
      remarks_.push_back(name + (images.empty() ? " has no images"
                                 : is_there
                                     ? " has no usable line in its list data.csv: its images are "
                                       "stamped by their names"
                                     : " has no list data.csv: its images are stamped by their "
                                       "names"));
      if (images.empty()) return require_no_pictures(k);
    }
    constexpr std::int64_t kShortest_ns = 100'000;
    const auto steps = static_cast<std::int64_t>(images.size()) - 1;
    if (steps > 0 && images.back().ns - images.front().ns < steps * kShortest_ns)
      return fail(ErrorCode::kInvalid,
                  name + ": its " + std::to_string(images.size()) +
                      " images are numbered, or their stamps count from zero in another unit than "
                      "ns: write " +
                      layout_.images_csv(k).filename().string() +
                      " with stamps in ns, and the names of the files");
    auto found = stream_of(name, images);
    if (!found) return tl::unexpected(found.error());
    found->unreadable = list.unreadable;
    found->first_fault = list.first_fault;
    for (std::size_t i = 1; i < images.size(); ++i)
      found->backwards += images[i].ns <= images[i - 1].ns ? 1 : 0;
    found->lens_fault = "no calibration";
    add_camera(std::move(*found), {std::move(images), "", {}});
    return {};
  }

  /// @return Error when there are pictures whose names are no times
  [[nodiscard]] Expected<void> require_no_pictures(std::size_t k) const {
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(image_folder(k), ignored))
      if (std::ranges::find(kEndings, entry.path().extension().string()) != kEndings.end())
        return fail(ErrorCode::kInvalid,
                    "has pictures, but no times of them: their names are no stamps, and " +
                        layout_.images_csv(k).string() + " is missing or has none",
                    image_folder(k).string());
    return {};
  }

  /// Beside the calibration of the camera, or in the camera's folder itself (Kalibr).
  [[nodiscard]] std::filesystem::path image_folder(std::size_t k) const {
    return is_folder(layout_.images(k)) ? layout_.images(k) : layout_.camera(k);
  }

  Expected<void> look_at_imu(const ImportOptions& options) {
    const auto csv =
        first_file({layout_.imu_csv(), layout_.mav() / "imu0.csv", layout_.mav() / "imu.csv"});
    if (!is_file(csv)) return {};
    auto table = read_imu_csv(csv.string(), options);
    if (!table) return tl::unexpected(table.error());
    table->found.name = "imu0";
    const Eigen::Matrix3d R_BI = about_.X_BI.rotation();
    for (ImuSample& sample : table->samples) {
      sample.sampled_at += options.imu_offset;
      sample.w_WB_B = R_BI * sample.w_WB_B;
      sample.f_B = R_BI * sample.f_B;
    }
    table->found.noise = about_.imu;
    add_imu(std::move(table->found), std::move(table->samples));
    return {};
  }

  /// From sensor.yaml; what is missing there from Kalibr's files, as in TUM-VI.
  void take_calibration(const std::vector<Error>& faults) {
    bool any = false;
    for (FoundStream& stream : streams_) {
      take_lens(static_cast<std::size_t>(std::stoul(stream.name.substr(3))), stream);
      any = any || stream.lens_known;
    }
    const auto folder = layout_.folder();
    const auto chain = first_file({folder / "camchain.yaml", folder / "dso" / "camchain.yaml",
                                   folder / "camchain-imucam.yaml"});
    std::optional<ImuNoise> noise;
    if (!any && is_file(chain) && apply_calibrations({chain.string()}, streams_, noise)) {
      remarks_.push_back("lenses and extrinsics are those of " +
                         chain.lexically_relative(folder).string());
      any = true;
    }
    const auto imu = first_file({folder / "dso" / "imu_config.yaml", folder / "imu_config.yaml",
                                 folder / "imu.yaml", folder / "imu0.yaml"});
    if (!about_.imu && is_file(imu)) {
      if (const auto read = read_imu_noise(imu.string())) {
        about_.imu = *read;
        remarks_.push_back("the IMU's noise is that of " + imu.lexically_relative(folder).string());
      } else {
        remarks_.push_back("the IMU's noise is not used: " + read.error().text());
      }
    }
    for (const Error& fault : faults)
      if (!fault.context.starts_with(layout_.mav().string() + "/cam"))
        remarks_.push_back(fault.text() + "; the other files are used");
  }

  /// Of sensor.yaml: with its place, or, where that is missing, the lens alone.
  void take_lens(std::size_t k, FoundStream& stream) {
    const CameraModel size = stream.mount.model;
    if (about_.cameras[k].model.width > 0) {
      stream.mount = about_.cameras[k];
      stream.place = CameraPlace::kOnBody;
    } else if (is_file(layout_.camera_yaml(k))) {
      const auto read = read_calibration(layout_.camera_yaml(k).string(), stream.mount);
      if (!read) {
        stream.lens_fault = read.error().text();
        return;
      }
      stream.mount = read->front().mount;
      stream.place = read->front().place;
    } else {
      return;
    }
    const CameraModel& lens = stream.mount.model;
    stream.lens_known = size.width == lens.width && size.height == lens.height;
    if (stream.lens_known) return;
    stream.lens_fault = "sensor.yaml is for images of " + size_text(lens.width, lens.height);
    stream.mount.model = size;
  }

  /// From data.csv: a stamp, and the name of a file, with or without ending, unless it is the
  /// stamp.
  [[nodiscard]] std::vector<ListedImage> listed(std::size_t k, FoundStream& found) const {
    std::vector<ListedImage> images;
    auto rows = CsvReader::open(layout_.images_csv(k));
    if (!rows) return images;
    int exponent = -1;
    while (rows->next()) {
      const std::string_view stamp = rows->fields()[0];
      const bool is_number = stamp.find_first_not_of("0123456789.") == std::string_view::npos;
      if (is_number && exponent < 0) exponent = stamp_exponent(stamp);
      ListedImage image;
      if (!is_number || !parse_time(stamp, std::max(exponent, 0), image.ns)) {
        if (rows->line() > 1 && found.unreadable++ == 0)
          found.first_fault = layout_.images_csv(k).string() + " line " +
                              std::to_string(rows->line()) + " begins with no time";
        continue;
      }
      const bool named = rows->fields().size() > 1 && !rows->fields()[1].empty();
      const std::filesystem::path name(named ? rows->fields()[1] : stamp);
      image.file = picture(image_folder(k) / name.filename()).string();
      images.push_back(std::move(image));
    }
    return images;
  }

  /// The file itself, or that with an ending, or with another one.
  static std::filesystem::path picture(const std::filesystem::path& path) {
    if (is_file(path)) return path;
    const bool has_ending =
        std::ranges::find(kEndings, path.extension().string()) != kEndings.end();
    const std::string stem =
        has_ending ? std::filesystem::path(path).replace_extension().string() : path.string();
    for (const std::string_view ending : kEndings)
      if (const std::filesystem::path whole = stem + std::string(ending); is_file(whole))
        return whole;
    return path;
  }

  RecordingLayout layout_;
  RecordingInfo about_;
};

}  // namespace

std::vector<ListedImage> pictures_by_time(const std::string& folder, int exponent) {
  std::vector<ListedImage> images;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string stem = entry.path().stem().string();
    if (stem.find_first_not_of("0123456789.") != std::string::npos || stem.empty()) continue;
    if (exponent < 0) exponent = stamp_exponent(stem);
    ListedImage image;
    if (!parse_time(stem, exponent, image.ns)) continue;
    image.file = entry.path().string();
    images.push_back(std::move(image));
  }
  std::ranges::sort(images, {}, &ListedImage::ns);
  return images;
}

bool is_asl_folder(const std::string& path) { return asl_layout(path).has_value(); }

OpenedImport open_asl_import(const std::string& path, const ImportOptions& options) {
  auto source = std::make_unique<AslImport>(*asl_layout(path));
  return source->look(options).map([&] { return std::move(source); });
}

}  // namespace fiducap
