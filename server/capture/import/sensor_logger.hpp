#pragma once

#include <memory>
#include <string>

#include "capture/import/import_source.hpp"

namespace fiducap {

/// A recording of the app Sensor Logger (iOS, Android): its ZIP archive, or the folder with
/// Gyroscope.csv, Accelerometer.csv and Gravity.csv (or TotalAcceleration.csv) and Camera/.
///
/// Axes are the phone's (x right, y up, z out of the screen), and specific force has Android's
/// sign: iOS has the other one unless the app was told to standardise, which Metadata.csv tells.
[[nodiscard]] Expected<std::unique_ptr<ImportSource>> open_sensor_logger(
    const std::string& path, const ImportOptions& options);

/// Gyroscope.csv is there.
[[nodiscard]] bool is_sensor_logger_folder(const std::string& path);

}  // namespace fiducap
