#include "capture/recording/recording_source.hpp"

#include "base/log.hpp"

namespace fiducap {
namespace {

bool parse_sighting(std::span<const std::string_view> fields, TagSighting& tag) {
  std::array<double, 8> uv{};
  if (fields.size() < 11 || !parse_number(fields[1], tag.tag_id) ||
      !parse_number(fields[2], tag.hamming) || !parse(fields.subspan(3), uv)) {
    return false;
  }
  for (std::size_t i = 0; i < 4; ++i) tag.corners_px[i] = {uv[2 * i], uv[2 * i + 1]};
  return true;
}

/// The streams of a recording merged by time, once or in a loop.
class RecordingSource final : public SensorSource {
 public:
  RecordingSource(RecordingInfo info, const RecordingPlayback& playback, const Clock& clock)
      : info_(std::move(info)), playback_(playback), clock_(clock) {}

  Expected<void> rewind() {
    Expected<std::vector<SampleStream>> streams = open_streams(info_, pool_);
    if (!streams) return tl::unexpected(streams.error());
    lanes_.clear();
    for (SampleStream& stream : *streams) {
      lanes_.push_back({std::move(stream), std::nullopt});
      advance(lanes_.back());
    }
    first_.reset();
    last_.reset();
    pass_ended_ = false;
    return {};
  }

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    if (stop.stop_requested()) return std::nullopt;
    Lane* lane = earliest();
    if (lane == nullptr) {
      const Expected<bool> again = start_again();
      if (!again) return tl::unexpected(again.error());
      lane = *again ? earliest() : nullptr;
      if (lane == nullptr) return std::nullopt;
    }
    const Instant recorded = time_of(*lane->head);
    if (!first_ || recorded < *first_) first_ = recorded;
    if (!last_ || recorded > *last_) last_ = recorded;
    const Instant at = moved(recorded);
    if (playback_.paced && !clock_.wait_until(at, stop)) return std::nullopt;
    SensorSample sample = std::move(*lane->head);
    advance(*lane);
    set_time(sample, at);
    return sample;
  }

 private:
  struct Lane {
    SampleStream stream;
    std::optional<SensorSample> head;
  };

  void advance(Lane& lane) {
    lane.head = std::visit([](auto& stream) { return stream.next(); }, lane.stream);
  }

  Lane* earliest() {
    Lane* found = nullptr;
    for (Lane& lane : lanes_) {
      if (lane.head && (found == nullptr || time_of(*lane.head) < time_of(*found->head)))
        found = &lane;
    }
    return found;
  }

  // @return false at the end.
  Expected<bool> start_again() {
    if (!std::exchange(pass_ended_, true) && first_pass_)
      for (const Lane& lane : lanes_)
        std::visit([](const auto& stream) { stream.log_damage(); }, lane.stream);
    if (!playback_.loop || !first_) return false;  // without any sample it would never return
    const double rate_hz = info_.cameras.empty() ? 20.0 : info_.cameras.front().rate_hz;
    const Duration gap = from_seconds(1.0 / (rate_hz > 1e-3 ? rate_hz : 20.0));
    pass_offset_ += *last_ - *first_ + gap;
    first_pass_ = false;
    if (const auto opened = rewind(); !opened) return tl::unexpected(opened.error());
    return true;
  }

  Instant moved(Instant recorded) {
    const Instant of_all_passes = recorded + pass_offset_;
    if (!playback_.paced) return of_all_passes;
    if (!played_from_) {
      played_from_ = of_all_passes;
      played_at_ = clock_.now();
    }
    const Duration since_start = of_all_passes - *played_from_;
    if (playback_.speed == 1.0) return played_at_ + since_start;
    return played_at_ + from_seconds(to_seconds(since_start) / playback_.speed);
  }

  RecordingInfo info_;
  RecordingPlayback playback_;
  const Clock& clock_;
  GrayImagePool pool_;
  std::vector<Lane> lanes_;
  bool first_pass_{true};
  bool pass_ended_{false};
  Duration pass_offset_{0};             ///< Added to every stamp of this pass.
  std::optional<Instant> first_;        ///< Of this pass, as recorded.
  std::optional<Instant> last_;         ///< Newest of this pass, as recorded.
  std::optional<Instant> played_from_;  ///< First stamp of the first pass, as recorded …
  Instant played_at_{};                 ///< … and when it was released.
};

}  // namespace

Expected<ImuStream> ImuStream::open(const RecordingLayout& layout, const RecordingInfo& info) {
  return StampedRows::open(layout.imu_csv()).map([&](StampedRows rows) {
    return ImuStream(std::move(rows), info.X_BI);
  });
}

std::optional<SensorSample> ImuStream::next() {
  for (std::int64_t ns = 0; rows_.next(ns);) {
    std::array<double, 6> v{};
    if (parse(rows_.fields().subspan(1), v))
      return ImuSample{instant_from_ns(ns), R_BI_ * Eigen::Vector3d(v[0], v[1], v[2]),
                       R_BI_ * Eigen::Vector3d(v[3], v[4], v[5])};
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

Expected<ImageStream> ImageStream::open(const RecordingLayout& layout, const RecordingInfo& info,
                                        std::size_t camera, GrayImagePool& pool) {
  return StampedRows::open(layout.images_csv(camera)).map([&](StampedRows rows) {
    return ImageStream(std::move(rows), layout.images(camera), info.cameras[camera],
                       static_cast<int>(camera), pool);
  });
}

std::optional<SensorSample> ImageStream::next() {
  for (std::int64_t ns = 0; rows_.next(ns);) {
    const std::filesystem::path file = file_of_row(ns);
    if (file.empty()) {
      rows_.count_damaged();
      continue;
    }
    std::shared_ptr<GrayImage> image = pool_->acquire();
    const PixelSize size{mount_.model.width, mount_.model.height};
    const Expected<void> decoded = decoder_.read_file(file, size, *image);
    if (decoded)
      return CameraFrame{camera_, instant_from_ns(ns) + mount_.time_shift, std::move(image)};
    if (dropped_++ == 0)
      log::warning("capture", decoded.error().text() + "; such images are left out");
  }
  return std::nullopt;
}

// The name in the list, else <ns>.png or <ns>.jpg. Empty when it leads out of the folder.
std::filesystem::path ImageStream::file_of_row(std::int64_t ns) const {
  if (rows_.fields().size() > 1 && !rows_.fields()[1].empty()) {
    const std::filesystem::path name(rows_.fields()[1]);
    return name == name.filename() && name != ".." ? folder_ / name : std::filesystem::path();
  }
  const std::filesystem::path jpg = folder_ / (std::to_string(ns) + ".jpg");
  return is_file(jpg) ? jpg : folder_ / (std::to_string(ns) + ".png");
}

void ImageStream::log_damage() const {
  rows_.log_damage();
  if (dropped_ > 0)
    log::warning("capture",
                 folder_.string() + ": " + std::to_string(dropped_) + " images left out");
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

OpenedSource open_recording(const RecordingInfo& info, const RecordingPlayback& playback,
                            const Clock& clock) {
  if (playback.paced && !(playback.speed >= 0.01 && playback.speed <= 100))
    return fail(ErrorCode::kInvalid, "speed must be in [0.01, 100]", info.folder);
  if (playback.paced && playback.speed != 1.0 && info.imu)
    return fail(ErrorCode::kUnsupported,
                "speed must be 1 for a recording with IMU: its readings do not fit another speed",
                info.folder);
  auto source = std::make_unique<RecordingSource>(info, playback, clock);
  return source->rewind().map([&] { return std::move(source); });
}

std::vector<ConfigError> check_source(const RecordingSourceConfig& config,
                                      const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  return Checker{body_prefix}
      .require(!config.folder.empty(), "source.folder", "\"\"", "must name a recording")
      .positive("source.speed", config.speed)
      .require(!around.has_imu_source, "imu_source", "{…}",
               "must not be given: a recording contains its IMU")
      .errors;
}

}  // namespace fiducap
