#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <variant>

#include "capture/gray_image.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// imu0/data.csv in body axes.
class ImuStream final {
 public:
  [[nodiscard]] static Expected<ImuStream> open(const RecordingLayout& layout,
                                                const RecordingInfo& info);
  [[nodiscard]] std::optional<SensorSample> next();
  void log_damage() const { rows_.log_damage(); }

 private:
  ImuStream(StampedRows rows, const Pose& X_BI) : rows_(std::move(rows)), R_BI_(X_BI.rotation()) {}

  StampedRows rows_;
  Eigen::Matrix3d R_BI_;
};

/// tags<K>/data.csv, its rows joined per image; frames.csv adds the images without tags.
class CornerStream final {
 public:
  [[nodiscard]] static Expected<CornerStream> open(const RecordingLayout& layout,
                                                   const RecordingInfo& info, std::size_t camera);
  [[nodiscard]] std::optional<SensorSample> next();
  void log_damage() const {
    rows_.log_damage();
    if (frames_) frames_->log_damage();
  }

 private:
  struct Row {
    std::int64_t ns{};
    TagSighting tag;
  };
  CornerStream(StampedRows rows, int camera, Duration time_shift)
      : rows_(std::move(rows)), camera_(camera), time_shift_(time_shift) {}
  void read_row();
  void read_frame() {
    frame_ns_.reset();
    std::int64_t ns = 0;
    if (frames_ && frames_->next(ns)) frame_ns_ = ns;
  }

  StampedRows rows_;
  std::optional<StampedRows> frames_;
  int camera_;
  Duration time_shift_;
  std::optional<Row> row_;                ///< Next one, already read.
  std::optional<std::int64_t> frame_ns_;  ///< Same.
};

/// cam<K>/data.csv and its images. Files that are no images of the calibrated size are left out.
class ImageStream final {
 public:
  [[nodiscard]] static Expected<ImageStream> open(const RecordingLayout& layout,
                                                  const RecordingInfo& info, std::size_t camera,
                                                  GrayImagePool& pool);
  [[nodiscard]] std::optional<SensorSample> next();
  void log_damage() const;

 private:
  ImageStream(StampedRows rows, std::filesystem::path folder, const CameraMount& mount, int camera,
              GrayImagePool& pool)
      : rows_(std::move(rows)),
        folder_(std::move(folder)),
        mount_(mount),
        camera_(camera),
        pool_(&pool) {}
  [[nodiscard]] std::filesystem::path file_of_row(std::int64_t ns) const;

  StampedRows rows_;
  std::filesystem::path folder_;
  CameraMount mount_;
  int camera_;
  GrayImagePool* pool_;
  GrayDecoder decoder_;
  std::uint64_t dropped_{0};
};

using SampleStream = std::variant<ImuStream, CornerStream, ImageStream>;

/// All streams of a recording, IMU first. Images are preferred to corners.
/// @param pool  outlives the streams
[[nodiscard]] Expected<std::vector<SampleStream>> open_streams(const RecordingInfo& info,
                                                               GrayImagePool& pool);

}  // namespace fiducap
