#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

enum class FoundKind { kImages, kImu };

/// A stream of samples in a source, and its properties before the import.
struct FoundStream {
  FoundKind kind{FoundKind::kImages};
  std::string name;  ///< A topic, or a file.
  std::string type;  ///< In the terms of its source.
  std::uint64_t count{0};
  std::int64_t first_ns{0};  ///< Of the usable stamps.
  std::int64_t last_ns{0};
  std::uint64_t zero_stamps{0};
  std::uint64_t backwards{0};   ///< Stamps not later than one before.
  std::uint64_t unreadable{0};  ///< Messages or lines.
  std::string first_fault;      ///< Fault of the first of them.

  std::string encoding;                      ///< Of images, if known.
  int used_bits{8};                          ///< Of the channels of its images.
  bool is_depth{false};                      ///< A depth image.
  CameraMount mount = calibrated_mount();    ///< Size if known (else 0), and …
  bool lens_known{false};                    ///< … the rest of the model,
  std::string lens_fault;                    ///< … or why it is unknown;
  CameraPlace place{CameraPlace::kUnknown};  ///< … X_BV and the clock.
  std::optional<ImuNoise> noise;
  bool has_gyro{true};   ///< Of an IMU: any reading of it is not zero.
  bool has_accel{true};  ///< … likewise.

  /// In messages: kind, name, count.
  [[nodiscard]] std::string text() const {
    std::string all = name + " (" + type;
    if (mount.model.width > 0) all += ", " + size_text(mount.model.width, mount.model.height);
    if (!encoding.empty()) all += ", " + encoding;
    return all + ")";
  }
  /// Mean; 0 when there are less than two.
  [[nodiscard]] double rate_hz() const {
    if (count < 2 || last_ns <= first_ns) return 0;
    return static_cast<double>(count - 1) * 1e9 / static_cast<double>(last_ns - first_ns);
  }
};

/// The imported streams. Cameras are numbered in this order.
struct ImportChoice {
  std::vector<std::size_t> images;  ///< Indices among streams().
  std::optional<std::size_t> imu;
  std::optional<std::size_t> accel;  ///< Of an IMU stream that has the gyroscope only.
};

/// A recording of another program.
class ImportSource {
 public:
  virtual ~ImportSource() = default;
  [[nodiscard]] virtual const std::vector<FoundStream>& streams() const = 0;
  /// Names and types of other content.
  [[nodiscard]] virtual std::vector<std::string> others() const { return {}; }
  /// Assumptions made, and faults of the files.
  [[nodiscard]] virtual std::vector<std::string> remarks() const = 0;
  /// All cameras are on one body and are all imported.
  [[nodiscard]] virtual bool is_one_rig() const { return false; }
  /// Tags and axes of the IMU; the rest is ignored.
  [[nodiscard]] virtual RecordingInfo about() const { return {}; }
  [[nodiscard]] virtual bool has_tags() const { return false; }
  [[nodiscard]] virtual Expected<std::vector<TruthSample>> truth() const {
    return std::vector<TruthSample>{};
  }
  /// The samples of the chosen streams: each stream in order, interleaved in any order.
  /// @param cameras  in the order of the choice, their models with the size of the images
  [[nodiscard]] virtual OpenedSource open(const ImportChoice& choice,
                                          const std::vector<CameraMount>& cameras) = 0;
};

using OpenedImport = Expected<std::unique_ptr<ImportSource>>;

struct ImportOptions {
  const Clock* clock{nullptr};  ///< Of videos, which are not paced; outlives them.
  bool log_stamps{false};       ///< The recorder's time instead of the sensor's.
  Duration imu_offset{0};       ///< Added to the stamps of the IMU.
  std::string imu_csv;          ///< With a video.
  std::string imu_columns;      ///< Names of time, gyro x y z, accelerometer x y z; empty: guessed.
  std::string imu_units;        ///< Of time, gyro, accelerometer; empty: guessed.
};

/// Called periodically while a source is read, with the share that is done.
using ImportProgress = std::function<void(double share)>;

/// Reads the content of a bag, MCAP, rosbag2, video, EuRoC folder, phone log or table of an IMU;
/// of several bags, MCAP or rosbag2 as one recording.
/// @return Error with the expected formats
[[nodiscard]] OpenedImport open_import(const std::vector<std::string>& paths,
                                       const ImportOptions& options,
                                       const ImportProgress& progress);

/// Replaces the calibration by files: Kalibr's imu.yaml, and the cameras of files that
/// read_calibration knows, in order: one file of all, or one for each. EuRoC's T_BS is used, too.
/// @return Error with the file, also when it is for another size of images
[[nodiscard]] Expected<void> apply_calibrations(const std::vector<std::string>& files,
                                                std::vector<FoundStream>& cameras,
                                                std::optional<ImuNoise>& noise);

}  // namespace fiducap
