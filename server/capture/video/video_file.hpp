#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "base/clock.hpp"
#include "capture/camera_device.hpp"
#include "capture/sensor_source.hpp"
#include "capture/video/video_stream.hpp"

namespace fiducap::video {

/// A video file: images are stamped by their place in it.
///
/// One that is played at its own pace leaves out images when this computer is too slow for all of
/// them, and plays slower when it is too slow even for that. Both is said once.
class VideoFile final : public SensorSource {
 public:
  /// @param rate_hz  as the file says; 0: it does not
  VideoFile(std::unique_ptr<VideoStream> stream, double rate_hz, const CameraDeviceConfig& config,
            const Clock& clock);
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

  /// Images that were left out because there was no time for them.
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }

 private:
  [[nodiscard]] Duration place_of_image();
  [[nodiscard]] bool rewind();
  [[nodiscard]] bool leaves_out(Duration in_video);
  [[nodiscard]] std::string pace_text() const;
  void say_left_out();
  void play_slower(Duration by);
  void count(Duration work);

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
  bool has_said_left_out_{false};
  bool has_said_slower_{false};
};

}  // namespace fiducap::video
