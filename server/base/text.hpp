#pragma once

#include <string>

namespace fiducap {

/// Fixed-point text, e.g. fixed(1.2345, 2) == "1.23".
[[nodiscard]] std::string fixed(double value, int decimals);

}  // namespace fiducap
