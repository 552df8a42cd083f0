#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "capture/import/import_source.hpp"
#include "capture/import/message_log.hpp"

namespace fiducap {

/// Which message of ROS a topic carries, of those that become a recording.
enum class RosType { kImage, kCompressedImage, kImu, kCameraInfo, kOther };

[[nodiscard]] RosType ros_type(const LoggedTopic& topic);

/// Everything that a log says before it is imported.
struct LogSurvey {
  std::vector<FoundStream> streams;  ///< In order of appearance.
  std::vector<std::string> others;
  std::vector<std::string> remarks;
};

/// Reads a log to its end: counts, stamps, sizes, lenses. Pictures are not decoded.
/// @param log_stamps  the recorder's time instead of that in the header
[[nodiscard]] Expected<LogSurvey> survey_log(MessageLog& log, bool log_stamps,
                                             const ImportProgress& progress);

}  // namespace fiducap
