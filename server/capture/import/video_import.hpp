#pragma once

#include <memory>
#include <string>

#include "capture/import/import_source.hpp"

namespace fiducap {

/// A video file, alone or with a table of an IMU (`options.imu_csv`).
///
/// A video says nothing of the time of day. A table whose first time is within a minute of zero
/// counts from the video's first image; any other begins with it. `options.imu_offset` moves it
/// from there.
[[nodiscard]] Expected<std::unique_ptr<ImportSource>> open_video_import(
    const std::string& path, const ImportOptions& options);

/// What a video shows of itself: size, and how it is called.
[[nodiscard]] Expected<FoundStream> look_at_video(const std::string& path, const Clock& clock);

}  // namespace fiducap
