#pragma once

#include <memory>
#include <string>

#include "capture/import/message_log.hpp"

namespace fiducap {

/// An MCAP file, profiles ros1 and ros2, chunks packed by none, lz4 or zstd. Read from front to
/// back; a summary is not needed. Checksums are checked where the file has them.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_mcap(const std::string& path);

}  // namespace fiducap
