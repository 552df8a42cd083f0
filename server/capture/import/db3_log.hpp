#pragma once

#include <memory>
#include <string>

#include "capture/import/message_log.hpp"

namespace fiducap {

/// One SQLite file of rosbag2. Opened for reading only; a damaged one is read up to there.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_db3(const std::string& path);

}  // namespace fiducap
