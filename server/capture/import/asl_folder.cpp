#include "capture/import/import_parts.hpp"

#include <algorithm>
#include <filesystem>

#include "capture/import/imu_csv.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

class AslImport final : public PartsImport {
 public:
  explicit AslImport(RecordingLayout layout) : PartsImport(nullptr), layout_(std::move(layout)) {}

  Expected<void> look(const ImportOptions& options) {
    for (std::size_t k = 0; is_folder(layout_.camera(k)); ++k)
      if (const auto looked = look_at_camera(k); !looked) return looked;
    take_calibration();
    if (is_folder(layout_.detections(0)))
      remarks_.emplace_back(
          "its corners (tags0) are not imported: tags are detected in the images");
    return look_at_imu(options);
  }

  bool is_one_rig() const override { return true; }
  RecordingInfo about() const override { return about_; }
  bool has_tags() const override { return is_file(layout_.tags_yaml()); }
  Expected<std::vector<TruthSample>> truth() const override {
    return read_truth(layout_.folder().string());
  }

 private:
  Expected<void> look_at_camera(std::size_t k) {
    const std::string name = "cam" + std::to_string(k);
    std::uint64_t unreadable = 0;
    std::vector<ListedImage> images = listed(k, unreadable);
    if (images.empty()) {
      images = pictures_by_number(layout_.images(k).string(), 1);
      remarks_.push_back(
          name + (images.empty() ? " has no images"
                                 : " has no list data.csv: its images are stamped by their names"));
      if (images.empty()) return {};
    }
    auto found = stream_of(name, images);
    if (!found) return tl::unexpected(found.error());
    found->unreadable = unreadable;
    for (std::size_t i = 1; i < images.size(); ++i)
      found->backwards += images[i].ns <= images[i - 1].ns ? 1 : 0;
    found->lens_fault = "no calibration";
    add_camera(std::move(*found), {std::move(images), "", {}});
    return {};
  }

  Expected<void> look_at_imu(const ImportOptions& options) {
    if (!is_file(layout_.imu_csv())) return {};
    auto table = read_imu_csv(layout_.imu_csv().string(), options);
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

  /// From sensor.yaml, or from a Kalibr file as in TUM-VI.
  void take_calibration() {
    const auto info = read_recording_info(layout_.folder().string());
    if (info) {
      about_ = *info;
      for (FoundStream& stream : streams_) {
        const std::size_t k = static_cast<std::size_t>(std::stoul(stream.name.substr(3)));
        if (k >= info->cameras.size()) continue;
        const CameraModel size = stream.mount.model;
        stream.mount = info->cameras[k];
        stream.place_known = true;
        stream.lens_known =
            size.width == stream.mount.model.width && size.height == stream.mount.model.height;
        if (stream.lens_known) continue;
        stream.mount.model = size;
        stream.lens_fault = "sensor.yaml is for images of another size";
      }
      return;
    }
    for (const char* name : {"camchain.yaml", "dso/camchain.yaml", "camchain-imucam.yaml"}) {
      const auto file = layout_.folder() / name;
      std::optional<ImuNoise> noise;
      if (!is_file(file) || !apply_calibrations({file.string()}, streams_, noise)) continue;
      remarks_.push_back(std::string("lenses and extrinsics are those of ") + name);
      return;
    }
    remarks_.push_back("its own calibration is not used: " + info.error().text());
  }

  /// From data.csv: a stamp in nanoseconds, and the name of a file unless it is the stamp.
  [[nodiscard]] std::vector<ListedImage> listed(std::size_t k, std::uint64_t& unreadable) const {
    std::vector<ListedImage> images;
    auto rows = CsvReader::open(layout_.images_csv(k));
    if (!rows) return images;
    while (rows->next()) {
      ListedImage image;
      if (!parse_stamp(rows->fields()[0], image.ns)) {
        if (rows->line() > 1) ++unreadable;
        continue;
      }
      std::filesystem::path name = std::to_string(image.ns) + ".png";
      if (rows->fields().size() > 1 && !rows->fields()[1].empty()) name = rows->fields()[1];
      image.file = (layout_.images(k) / name.filename()).string();
      images.push_back(std::move(image));
    }
    return images;
  }

  RecordingLayout layout_;
  RecordingInfo about_;
};

}  // namespace

std::vector<ListedImage> pictures_by_number(const std::string& folder, std::int64_t unit_ns) {
  std::vector<ListedImage> images;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    ListedImage image;
    const std::string stem = entry.path().stem().string();
    if (!parse_number(stem, image.ns) || image.ns < 0) continue;
    if (image.ns > 4'000'000'000'000'000'000 / unit_ns) continue;
    image.ns *= unit_ns;
    image.file = entry.path().string();
    images.push_back(std::move(image));
  }
  std::ranges::sort(images, {}, &ListedImage::ns);
  return images;
}

OpenedImport open_asl_import(const std::string& path, const ImportOptions& options) {
  auto layout = RecordingLayout::find(path);
  if (!layout) return tl::unexpected(layout.error());
  auto source = std::make_unique<AslImport>(std::move(*layout));
  return source->look(options).map([&] { return std::move(source); });
}

}  // namespace fiducap
