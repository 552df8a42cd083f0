#pragma once

#include <memory>
#include <string>

#include "capture/import/message_log.hpp"

namespace fiducap {

/// A bag of ROS 1, format 2.0, chunks packed by none, bz2 or lz4. Read from front to back, its
/// index is not needed.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_bag(const std::string& path);

}  // namespace fiducap
