#pragma once

#include <memory>
#include <string>

#include "capture/import/import_source.hpp"

namespace fiducap {

/// Messages of ROS from a bag, rosbag2 or MCAP.
[[nodiscard]] Expected<std::unique_ptr<ImportSource>> open_log_import(
    const std::string& path, const ImportOptions& options, const ImportProgress& progress);

}  // namespace fiducap
