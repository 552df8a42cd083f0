#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/import/import_source.hpp"
#include "capture/recording/recording.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct ImportArguments {
  std::vector<std::string> sources;  ///< Several: one recording in several files.
  std::string out;                   ///< Empty: only list what is there.
  std::vector<std::string> images;
  /// A topic, gyroscope and accelerometer, beside a video a file, or `none`.
  std::vector<std::string> imu;
  std::vector<std::string> calibrations;
  double tag_size_m{0};  ///< 0: that of the source.
  std::string tag_family;
  std::string stamps{"header"};
  double imu_offset_s{0};
  std::string imu_columns;
  std::string imu_units;
  bool json{false};
};

/// `fiducap import`: makes a recording of what another program recorded. Lists the streams, writes
/// the chosen ones, checks the result and lists what is still missing.
/// @return exit code; without `--out` only lists
int run_import(const ImportArguments& arguments, const Terminal& terminal);

/// What an import will make, before it makes it.
struct ImportPlan {
  ImportChoice choice;
  RecordingInfo info;
  std::vector<std::string> remarks;  ///< About the streams chosen.
  std::vector<std::string> to_do;    ///< What the source does not contain, and where to write it.
};

/// Chooses the streams that have only one choice.
/// @return Error naming what is missing and what there is, or the choices
[[nodiscard]] Expected<ImportChoice> choose_streams(const ImportSource& source,
                                                    const ImportArguments& arguments);

[[nodiscard]] Expected<ImportPlan> plan_import(const ImportSource& source,
                                               const ImportArguments& arguments);

}  // namespace fiducap
