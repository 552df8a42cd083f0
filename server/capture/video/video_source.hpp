#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/camera_device.hpp"
#include "capture/gray_image.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap::video {

/// Successive images of a decoder.
class VideoStream {
 public:
  virtual ~VideoStream() = default;
  /// Goes to the next image. @return false when there is none
  [[nodiscard]] virtual bool grab() = 0;
  /// Time in the file of the image grabbed last; negative: not known. Images at the end that the
  /// decoder held back have none (zero) with OpenCV's FFmpeg.
  [[nodiscard]] virtual Duration place() const = 0;
  /// The time of the first image in the file after this one; nullopt: not known.
  [[nodiscard]] virtual std::optional<Duration> place_after(Duration) { return std::nullopt; }
  /// The image grabbed last; null when it cannot be decoded.
  [[nodiscard]] virtual Expected<std::shared_ptr<const GrayImage>> image() = 0;
  /// Restarts a file. @return false when that fails
  [[nodiscard]] virtual bool rewind() = 0;
};

/// The times of all images of a video file as its container has them, increasing, the first image
/// at zero. Reads the whole file, decodes nothing; images without a time are left out.
/// @return empty when the file cannot be read
[[nodiscard]] std::vector<Duration> container_stamps(const std::string& path);

enum class VideoKind { kFile, kNetwork, kPipeline };

struct OpenedVideo {
  std::unique_ptr<VideoStream> stream;
  double rate_hz{0};  ///< 0: not known.
};

/// A file, an address on the network (FFmpeg) or a GStreamer pipeline, by OpenCV.
/// @param name    for messages
/// @param what    path, address or pipeline
/// @param camera  width 0: not calibrated yet, any size
[[nodiscard]] Expected<OpenedVideo> open_video(VideoKind kind, const std::string& name,
                                               const std::string& what, const CameraModel& camera);

/// A pipeline or a camera on the network: images are stamped when they arrive.
[[nodiscard]] std::unique_ptr<SensorSource> make_live_source(std::unique_ptr<VideoStream> stream,
                                                             const CameraDeviceConfig& config,
                                                             const Clock& clock);

/// A video file: images are stamped by their time in it.
///
/// A paced one leaves out images when this computer is too slow, and plays slower if need be.
class VideoFile final : public SensorSource {
 public:
  /// @param rate_hz  of the file; 0: not known
  VideoFile(std::unique_ptr<VideoStream> stream, double rate_hz, const CameraDeviceConfig& config,
            const Clock& clock);
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

  /// Images left out for lack of time.
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }

 private:
  [[nodiscard]] Duration place_of_image();
  [[nodiscard]] bool rewind();
  [[nodiscard]] bool leaves_out(Duration in_video);
  [[nodiscard]] std::string pace_text() const;

  std::unique_ptr<VideoStream> stream_;
  CameraDeviceConfig config_;
  const Clock& clock_;
  Duration period_{};
  Duration pass_offset_{0};
  std::optional<Duration> last_place_;  ///< Of this pass.
  std::optional<Instant> started_at_;   ///< When the first image was due, on the clock.
  bool some_in_pass_{false};

  std::uint64_t shown_{0};
  std::uint64_t left_out_{0};
  std::uint32_t left_out_in_a_row_{0};
  Duration work_{0};  ///< For the images shown.
  bool has_logged_left_out_{false};
  bool has_logged_slower_{false};
};

}  // namespace fiducap::video
