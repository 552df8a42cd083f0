#pragma once

#include <memory>
#include <string>

#include "capture/import/message_log.hpp"

namespace fiducap {

/// A folder of rosbag2: its files in the order of `metadata.yaml`, or of their names where that is
/// missing. Messages packed one by one (zstd) are unpacked.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_rosbag2_folder(const std::string& path);

}  // namespace fiducap
