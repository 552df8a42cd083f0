#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/import/import_source.hpp"
#include "capture/recording/recording.hpp"

namespace fiducap {

/// What a person asks of an import.
struct ImportArguments {
  std::string source;
  std::string out;  ///< Empty: only say what is there.
  std::vector<std::string> images;
  std::string imu;  ///< A topic, beside a video a file, or `none`.
  std::vector<std::string> calibrations;
  double tag_size_m{0};  ///< 0: as the source says.
  std::string tag_family;
  std::string stamps{"header"};
  double imu_offset_s{0};
  std::string imu_columns;
  std::string imu_units;
  bool json{false};
};

/// What an import will make, before it makes it.
struct ImportPlan {
  ImportChoice choice;
  RecordingInfo info;
  std::vector<std::string> remarks;  ///< About the streams chosen.
  std::vector<std::string> to_do;    ///< What the source does not say, and where to write it.
};

/// Chooses what has only one choice.
/// @return Error naming what is missing and what there is, or the choices
[[nodiscard]] Expected<ImportChoice> choose_streams(const ImportSource& source,
                                                    const ImportArguments& arguments);

[[nodiscard]] Expected<ImportPlan> plan_import(const ImportSource& source,
                                               const ImportArguments& arguments);

}  // namespace fiducap
