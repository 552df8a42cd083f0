#pragma once

#include <memory>
#include <string>

#include "base/expected.hpp"
#include "capture/camera_device.hpp"
#include "capture/video/video_stream.hpp"

namespace fiducap::video {

enum class VideoKind { kFile, kNetwork, kPipeline };

/// A stream, and how often it says that its images come; 0: it does not say.
struct OpenedVideo {
  std::unique_ptr<VideoStream> stream;
  double rate_hz{0};
};

/// A file, an address on the network (FFmpeg) or a GStreamer pipeline, by OpenCV.
/// @param name    for messages
/// @param what    path, address or pipeline
/// @param camera  width 0: not calibrated yet, any size will do
[[nodiscard]] Expected<OpenedVideo> open_video(VideoKind kind, const std::string& name,
                                               const std::string& what, const CameraModel& camera);

}  // namespace fiducap::video
