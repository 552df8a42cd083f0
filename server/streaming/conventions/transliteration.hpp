#pragma once

#include <string>

namespace fiducap {

/// A letter as ASCII writes it: ö → oe, é → e, ж → zh. Others by their number, 日 → u65e5: not
/// nice, but a name stays one that can be told from others. Letters, digits and _ only, never
/// empty.
/// @pre c is no character of ASCII
[[nodiscard]] std::string ascii_of(char32_t c);

}  // namespace fiducap
