#include "capture/recording/recording_streams.hpp"

#include <fstream>

#include "base/log.hpp"
#include "capture/recording/gray_file.hpp"

namespace fiducap {
namespace {

bool parse_sighting(std::span<const std::string_view> fields, TagSighting& tag) {
  std::array<double, 8> uv{};
  if (fields.size() < 11 || !parse(fields[1], tag.tag_id) || !parse(fields[2], tag.hamming) ||
      !parse(fields.subspan(3), uv)) {
    return false;
  }
  for (std::size_t i = 0; i < 4; ++i) tag.corners_px[i] = {uv[2 * i], uv[2 * i + 1]};
  return true;
}

}  // namespace

Expected<StampedRows> StampedRows::open(const std::filesystem::path& path) {
  Expected<CsvReader> rows = CsvReader::open(path);
  if (!rows) return tl::unexpected(rows.error());
  Expected<StampColumn> stamps = StampColumn::read(path);
  if (!stamps) return tl::unexpected(stamps.error());
  return StampedRows(std::move(*rows), std::move(*stamps));
}

bool StampedRows::next(std::int64_t& ns) {
  while (rows_.next()) {
    if (!rows_.line_is_complete()) return false;
    if (!parse_stamp(rows_.fields()[0], ns)) {
      rows_.count_damaged();
    } else if (stamps_.accepts(rows_.line())) {
      return true;
    }
  }
  return false;
}

void StampedRows::log_damage() const {
  rows_.log_damage();
  stamps_.log_left_out();
}

Expected<ImuStream> ImuStream::open(const RecordingLayout& layout, const RecordingInfo& info) {
  Expected<StampedRows> rows = StampedRows::open(layout.imu_csv());
  if (!rows) return tl::unexpected(rows.error());
  return ImuStream(std::move(*rows), info.X_BI);
}

std::optional<SensorSample> ImuStream::next() {
  for (std::int64_t ns = 0; rows_.next(ns);) {
    std::array<double, 6> v{};
    if (parse(rows_.fields().subspan(1), v)) {
      return ImuSample{instant_from_ns(ns), R_BI_ * Eigen::Vector3d(v[0], v[1], v[2]),
                       R_BI_ * Eigen::Vector3d(v[3], v[4], v[5])};
    }
    rows_.count_damaged();
  }
  return std::nullopt;
}

Expected<CornerStream> CornerStream::open(const RecordingLayout& layout, const RecordingInfo& info,
                                          std::size_t camera) {
  Expected<StampedRows> rows = StampedRows::open(layout.corners_csv(camera));
  if (!rows) return tl::unexpected(rows.error());
  CornerStream stream(std::move(*rows), static_cast<int>(camera), info.cameras[camera].time_shift);
  if (is_file(layout.frames_csv(camera))) {
    Expected<StampedRows> frames = StampedRows::open(layout.frames_csv(camera));
    if (!frames) return tl::unexpected(frames.error());
    stream.frames_ = std::move(*frames);
    stream.read_frame();
  }
  stream.read_row();
  return stream;
}

void CornerStream::read_row() {
  row_.reset();
  Row row;
  while (rows_.next(row.ns)) {
    if (parse_sighting(rows_.fields(), row.tag)) {
      row_ = row;
      return;
    }
    rows_.count_damaged();
  }
}

void CornerStream::read_frame() {
  frame_ns_.reset();
  std::int64_t ns = 0;
  if (frames_ && frames_->next(ns)) frame_ns_ = ns;
}

std::optional<SensorSample> CornerStream::next() {
  if (!row_ && !frame_ns_) return std::nullopt;
  const std::int64_t ns = row_ && (!frame_ns_ || row_->ns <= *frame_ns_) ? row_->ns : *frame_ns_;
  CornerFrame frame{camera_, instant_from_ns(ns) + time_shift_, {}};
  while (row_ && row_->ns == ns) {
    frame.tags.push_back(row_->tag);
    read_row();
  }
  if (frame_ns_ == ns) read_frame();
  return frame;
}

void CornerStream::log_damage() const {
  rows_.log_damage();
  if (frames_) frames_->log_damage();
}

Expected<ImageStream> ImageStream::open(const RecordingLayout& layout, const RecordingInfo& info,
                                        std::size_t camera, GrayImagePool& pool) {
  Expected<StampedRows> rows = StampedRows::open(layout.images_csv(camera));
  if (!rows) return tl::unexpected(rows.error());
  return ImageStream(std::move(*rows), layout.images(camera), info.cameras[camera],
                     static_cast<int>(camera), pool);
}

std::optional<SensorSample> ImageStream::next() {
  for (std::int64_t ns = 0; rows_.next(ns);) {
    const std::filesystem::path file = file_of_row(ns);
    if (file.empty()) {
      rows_.count_damaged();
    } else if (auto image = read(file)) {
      return CameraFrame{camera_, instant_from_ns(ns) + mount_.time_shift, std::move(image)};
    }
  }
  return std::nullopt;
}

// The name in the list, or <ns>.png / <ns>.jpg where the list has only stamps. Empty when the name
// leaves the folder.
std::filesystem::path ImageStream::file_of_row(std::int64_t ns) const {
  if (rows_.fields().size() > 1 && !rows_.fields()[1].empty()) {
    const std::filesystem::path name(rows_.fields()[1]);
    return name == name.filename() && name != ".." ? folder_ / name : std::filesystem::path();
  }
  const std::filesystem::path jpg = folder_ / (std::to_string(ns) + ".jpg");
  return is_file(jpg) ? jpg : folder_ / (std::to_string(ns) + ".png");
}

std::shared_ptr<const GrayImage> ImageStream::read(const std::filesystem::path& file) {
  std::shared_ptr<GrayImage> image = pool_->acquire();
  image->resize(mount_.model.width, mount_.model.height);
  const Expected<void> decoded = read_gray_file(file, file_bytes_, *image);
  if (decoded) return image;
  if (dropped_++ == 0)
    log::warning("capture", decoded.error().text() + "; such images are left out");
  return nullptr;
}

void ImageStream::log_damage() const {
  rows_.log_damage();
  if (dropped_ > 0) {
    log::warning("capture",
                 folder_.string() + ": " + std::to_string(dropped_) + " images left out");
  }
}

Expected<std::vector<SampleStream>> open_streams(const RecordingInfo& info, GrayImagePool& pool) {
  const Expected<RecordingLayout> layout = RecordingLayout::find(info.folder);
  if (!layout) return tl::unexpected(layout.error());
  std::vector<SampleStream> streams;
  const auto add = [&streams](auto stream) -> Expected<void> {
    if (!stream) return tl::unexpected(stream.error());
    streams.emplace_back(std::move(*stream));
    return {};
  };
  if (info.imu) {
    if (const auto added = add(ImuStream::open(*layout, info)); !added)
      return tl::unexpected(added.error());
  }
  bool any_camera = false;
  const auto has = [](const std::vector<bool>& per_camera, std::size_t k) {
    return k < per_camera.size() && per_camera[k];
  };
  for (std::size_t k = 0; k < info.cameras.size(); ++k) {
    Expected<void> added;
    if (has(info.has_images, k)) {
      added = add(ImageStream::open(*layout, info, k, pool));
    } else if (has(info.has_corners, k)) {
      added = add(CornerStream::open(*layout, info, k));
    } else {
      continue;
    }
    if (!added) return tl::unexpected(added.error());
    any_camera = true;
  }
  if (any_camera || info.imu) return streams;
  return fail(ErrorCode::kNotFound,
              "has neither images (cam0/data.csv, cam0/data/) nor detections (tags0/data.csv)",
              layout->mav().string());
}

}  // namespace fiducap
