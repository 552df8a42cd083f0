#include "capture/recording/recording_writer.hpp"

#include "capture/gray_image.hpp"

namespace fiducap {
namespace {

constexpr const char* kImuHeader =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
    "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]";
constexpr const char* kImagesHeader = "#timestamp [ns],filename";
constexpr const char* kCornersHeader =
    "#timestamp [ns],tag_id [],hamming [],u0 [px],v0 [px],u1 [px],v1 [px],u2 [px],v2 [px],u3 "
    "[px],v3 [px]";
constexpr const char* kFramesHeader = "#timestamp [ns],detections []";
constexpr const char* kTruthHeader =
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    "q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], "
    "b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], "
    "b_a_RS_S_z [m s^-2]";

// Of truth and calibration; sensor data are written exactly.
constexpr int kTruthDecimals = 9;

}  // namespace

Expected<CsvWriter*> RecordingWriter::LazyCsv::get(const std::filesystem::path& path,
                                                   const char* header) {
  if (!writer_) {
    Expected<CsvWriter> created = CsvWriter::create(path, header);
    if (!created) return tl::unexpected(created.error());
    writer_ = std::move(*created);
  }
  return &*writer_;
}

Expected<void> RecordingWriter::write_calibration() {
  for (std::size_t k = 0; k < info_.cameras.size(); ++k) {
    if (const auto done = write_text(layout_.camera_yaml(k), camera_yaml(info_.cameras[k])); !done)
      return done;
  }
  if (info_.imu) {
    const auto done = write_text(layout_.imu_yaml(), imu_yaml(info_));
    if (!done) return done;
    // Created at once: a recording has an IMU when it has this file.
    if (const auto csv = imu_.get(layout_.imu_csv(), kImuHeader); !csv)
      return tl::unexpected(csv.error());
  }
  return write_text(layout_.tags_yaml(), tags_yaml(info_));
}

// Time of the camera's clock: the reader adds the time shift again.
Expected<std::int64_t> RecordingWriter::camera_stamp(int camera, Instant exposed_at) const {
  if (camera < 0 || camera >= static_cast<int>(info_.cameras.size()))
    return fail(ErrorCode::kInvalid, "has no camera " + std::to_string(camera), info_.folder);
  const std::int64_t ns =
      to_ns(exposed_at - info_.cameras[static_cast<std::size_t>(camera)].time_shift);
  if (ns < 0)
    return fail(ErrorCode::kInvalid, "stamp " + std::to_string(ns) + " ns is before the epoch",
                info_.folder);
  return ns;
}

Expected<void> RecordingWriter::append(const ImuSample& sample) {
  if (!info_.imu) return fail(ErrorCode::kInvalid, "was created without IMU", info_.folder);
  const auto csv = imu_.get(layout_.imu_csv(), kImuHeader);
  if (!csv) return tl::unexpected(csv.error());
  return (*csv)
      ->integer(to_ns(sample.sampled_at))
      .exact(R_IB_ * sample.w_WB_B)
      .exact(R_IB_ * sample.f_B)
      .end_line();
}

Expected<void> RecordingWriter::append(const CameraFrame& frame) {
  const auto ns = camera_stamp(frame.camera, frame.exposed_at - frame.clock_shift);
  if (!ns) return tl::unexpected(ns.error());
  const auto k = static_cast<std::size_t>(frame.camera);
  const auto csv = cameras_[k].images.get(layout_.images_csv(k), kImagesHeader);
  if (!csv) return tl::unexpected(csv.error());
  const std::string name = std::to_string(*ns) + ".png";
  // The image before its line: the list never names a missing image.
  const auto image = write_gray_file(layout_.images(k) / name, scratch_, *frame.image);
  if (!image) return tl::unexpected(image.error());
  whole_files_bytes_ += *image;
  return (*csv)->integer(*ns).text(name).end_line();
}

Expected<void> RecordingWriter::append(const CornerFrame& frame) {
  const auto ns = camera_stamp(frame.camera, frame.exposed_at - frame.clock_shift);
  if (!ns) return tl::unexpected(ns.error());
  const auto k = static_cast<std::size_t>(frame.camera);
  const auto corners = cameras_[k].corners.get(layout_.corners_csv(k), kCornersHeader);
  if (!corners) return tl::unexpected(corners.error());
  const auto frames = cameras_[k].frames.get(layout_.frames_csv(k), kFramesHeader);
  if (!frames) return tl::unexpected(frames.error());
  for (const TagSighting& tag : frame.tags) {
    CsvWriter& row = (*corners)->integer(*ns).integer(tag.tag_id).integer(tag.hamming);
    for (const Eigen::Vector2d& px : tag.corners_px) row.exact(px.x()).exact(px.y());
    if (const auto done = row.end_line(); !done) return done;
  }
  return (*frames)->integer(*ns).integer(static_cast<std::int64_t>(frame.tags.size())).end_line();
}

Expected<void> RecordingWriter::write_truth(const TruthSample& truth) {
  const auto csv = state_.get(layout_.state_csv(), kTruthHeader);
  if (!csv) return tl::unexpected(csv.error());
  return (*csv)
      ->integer(to_ns(truth.at))
      .pose(truth.X_WB, kTruthDecimals)
      .vector(truth.v_WB, kTruthDecimals)
      .vector(truth.bias_w, kTruthDecimals)
      .vector(truth.bias_f, kTruthDecimals)
      .end_line();
}

Expected<void> RecordingWriter::write_text(const std::filesystem::path& path,
                                           const std::string& text) {
  const auto written = write_output_file(path, text);
  if (!written) return tl::unexpected(written.error());
  whole_files_bytes_ += *written;
  return {};
}

Expected<void> RecordingWriter::on_all(Expected<void> (LazyCsv::*action)()) {
  Expected<void> all;
  const auto act = [&](LazyCsv& csv) {
    if (auto done = (csv.*action)(); !done && all) all = std::move(done);
  };
  act(imu_);
  act(state_);
  for (CameraFiles& camera : cameras_)
    for (LazyCsv* csv : {&camera.images, &camera.corners, &camera.frames}) act(*csv);
  return all;
}

Expected<RecordingWriter> RecordingWriter::create(const RecordingInfo& info) {
  std::error_code error;
  std::filesystem::create_directories(info.folder, error);
  if (error)
    return fail(ErrorCode::kUnavailable, "cannot be created: " + error.message(), info.folder);
  if (!std::filesystem::is_empty(info.folder, error) || error)
    return fail(
        ErrorCode::kInvalid,
        "is not empty: a recording never overwrites anything; remove it, or choose another one",
        info.folder);
  RecordingWriter writer(info);
  return writer.write_calibration().map([&] { return std::move(writer); });
}

Expected<void> RecordingWriter::write_truth_tags(const std::vector<RecordedTag>& tags) {
  Expected<CsvWriter> csv =
      CsvWriter::create(layout_.truth_tags_csv(), "id,size,px,py,pz,qw,qx,qy,qz");
  if (!csv) return tl::unexpected(csv.error());
  for (const RecordedTag& tag : tags) {
    const auto done = csv->integer(tag.tag_id)
                          .number(tag.edge_m, kTruthDecimals)
                          .pose(tag.X_WT, kTruthDecimals)
                          .end_line();
    if (!done) return done;
  }
  return csv->flush();
}

}  // namespace fiducap
