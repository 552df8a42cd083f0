#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace fiducap {

/// Fixed-point text, e.g. fixed(1.2345, 2) == "1.23".
[[nodiscard]] std::string fixed(double value, int decimals);
/// The shortest text that reads back as the same number.
[[nodiscard]] std::string shortest(double value);

/// Escapes control characters and DEL as `\x1b`, so that text from outside can neither move the
/// cursor nor fake a second line. UTF-8 is preserved.
[[nodiscard]] std::string escape_controls(std::string_view text);

/// Removes the first UTF-8 character of a text. Strict, as RFC 3629: no overlong form, no
/// surrogate.
/// @return nullopt when the text does not begin with a character; then its first byte is removed
/// @pre !text.empty()
[[nodiscard]] std::optional<char32_t> take_character(std::string_view& text);

/// The known word with the smallest edit distance (letters replaced, missing, added or swapped with
/// a neighbour). Case is ignored; `-`, `_` and blanks are equal.
/// @return nullopt when none is near
[[nodiscard]] std::optional<std::string> closest_word(std::string_view written,
                                                      std::span<const std::string> known);
/// `did you mean X?`, or an empty text.
[[nodiscard]] std::string did_you_mean(std::string_view written,
                                       std::span<const std::string> known);
/// `must be one of a, b; did you mean b?`
[[nodiscard]] std::string must_be_one_of(std::span<const std::string> known,
                                         std::string_view written);

}  // namespace fiducap
