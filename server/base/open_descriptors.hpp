#pragma once

#include <vector>

namespace fiducap {

/// Of this process; empty when they cannot be told.
[[nodiscard]] std::vector<int> open_descriptors();

}  // namespace fiducap
