#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "base/expected.hpp"

namespace fiducap {

inline constexpr std::size_t kMaxTextFileBytes = std::size_t{256} << 20;

/// Replaces a file atomically: writes `content` beside `path` (no links), renames. Makes folders.
/// @param mode  of the file, less the umask
[[nodiscard]] Expected<void> write_whole_file(const std::string& path, std::string_view content,
                                              unsigned mode = 0666);

/// @return Error when the file is missing, unreadable or larger than `max_bytes`
[[nodiscard]] Expected<std::string> read_whole_file(const std::string& path,
                                                    std::size_t max_bytes = kMaxTextFileBytes);

}  // namespace fiducap
