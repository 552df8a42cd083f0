#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/calibrated_mount.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

enum class FoundKind { kImages, kImu };

/// A stream of samples that a source has, and what is known of it before it is imported.
struct FoundStream {
  FoundKind kind{FoundKind::kImages};
  std::string name;  ///< A topic, or a file.
  std::string type;  ///< What it is, in the words of its source.
  std::uint64_t count{0};
  std::int64_t first_ns{0};  ///< Of the stamps that are used.
  std::int64_t last_ns{0};
  std::uint64_t zero_stamps{0};
  std::uint64_t backwards{0};   ///< Stamps that are not later than one before.
  std::uint64_t unreadable{0};  ///< Messages or lines.
  std::string first_fault;      ///< What is wrong with the first of them.

  std::string encoding;                    ///< Of images, where the source says it.
  bool is_depth{false};                    ///< Distances, not brightness.
  CameraMount mount = calibrated_mount();  ///< Size where it is known (else 0), and …
  bool lens_known{false};                  ///< … the rest of the model,
  std::string lens_fault;                  ///< … or why there is none;
  bool place_known{false};                 ///< … X_BV and the clock.
  std::optional<ImuNoise> noise;

  /// In messages: kind, name, count.
  [[nodiscard]] std::string text() const;
  /// Mean; 0 when there are less than two.
  [[nodiscard]] double rate_hz() const;
};

/// What is taken of a source. Cameras are numbered as they stand here.
struct ImportChoice {
  std::vector<std::size_t> images;  ///< Indices among streams().
  std::optional<std::size_t> imu;
};

/// A recording that another program made, looked through once.
class ImportSource {
 public:
  virtual ~ImportSource() = default;
  [[nodiscard]] virtual const std::vector<FoundStream>& streams() const = 0;
  /// Names of what is there besides, each with its type.
  [[nodiscard]] virtual std::vector<std::string> others() const { return {}; }
  /// What was assumed, and what is wrong with the files.
  [[nodiscard]] virtual std::vector<std::string> remarks() const = 0;
  /// All cameras sit on one body: nobody has to choose.
  [[nodiscard]] virtual bool is_one_rig() const { return false; }
  /// What the source says of tags and of the IMU's axes; the rest is not looked at.
  [[nodiscard]] virtual RecordingInfo about() const { return {}; }
  [[nodiscard]] virtual bool tells_tags() const { return false; }
  [[nodiscard]] virtual Expected<std::vector<TruthSample>> truth() const {
    return std::vector<TruthSample>{};
  }
  /// The samples of what was chosen; of each stream in order, between them in any.
  /// @param cameras  in the order of the choice, their models with the size of the images
  [[nodiscard]] virtual Expected<std::unique_ptr<SensorSource>> open(
      const ImportChoice& choice, const std::vector<CameraMount>& cameras) = 0;
};

struct ImportOptions {
  const Clock* clock{nullptr};  ///< Of videos, which are not paced here: lives as long as they.
  bool log_stamps{false};       ///< The recorder's time instead of the sensor's.
  Duration imu_offset{0};       ///< Added to the stamps of the IMU.
  std::string imu_csv;          ///< Beside a video.
  std::string imu_columns;      ///< Names of time, gyro x y z, accelerometer x y z; empty: guessed.
  std::string imu_units;        ///< Of time, gyro, accelerometer; empty: guessed.
};

/// Called now and then while a source is looked through: what is read, 0 to 1.
using ImportProgress = std::function<void(double share)>;

/// Looks through a bag, MCAP, rosbag2, video, EuRoC folder or phone log, whatever `path` is.
/// @return Error saying what it is instead
[[nodiscard]] Expected<std::unique_ptr<ImportSource>> open_import(const std::string& path,
                                                                  const ImportOptions& options,
                                                                  const ImportProgress& progress);

}  // namespace fiducap
