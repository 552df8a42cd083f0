#pragma once

#include <string>

#include "fiducap/client.hpp"

namespace fiducap {

/// Heading line, column names and one line per body; every line ends with a line break.
[[nodiscard]] std::string watch_table(const std::string& server, const Frame& frame,
                                      const ClientStatistics& statistics);

/// One line per body, for logs.
[[nodiscard]] std::string watch_lines(const Frame& frame, const ClientStatistics& statistics);

/// One JSON object with everything, in one line. What is not known is null.
[[nodiscard]] std::string watch_json(const Frame& frame, const ClientStatistics& statistics);

}  // namespace fiducap
