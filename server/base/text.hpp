#pragma once

#include <string>

namespace fiducap {

/// Fixed-point text, e.g. fixed(1.2345, 2) == "1.23".
[[nodiscard]] std::string fixed(double value, int decimals);
/// As few digits as read back as the same number.
[[nodiscard]] std::string shortest(double value);

}  // namespace fiducap
