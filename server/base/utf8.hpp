#pragma once

#include <optional>
#include <string_view>

namespace fiducap {

/// Takes the first character off a text. Strict, as RFC 3629: no overlong form, no surrogate.
/// @return nothing when the text does not begin with one; then its first byte is gone
/// @pre !text.empty()
[[nodiscard]] std::optional<char32_t> take_character(std::string_view& text);

}  // namespace fiducap
