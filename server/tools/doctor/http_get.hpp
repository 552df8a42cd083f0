#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "base/expected.hpp"

namespace fiducap {

/// The body of an answer 200, at most 4 MB. Each wait ends after `patience`.
[[nodiscard]] Expected<std::string> http_get(const std::string& host, std::uint16_t port,
                                             const std::string& path,
                                             std::chrono::milliseconds patience);

}  // namespace fiducap
