#pragma once

#include <charconv>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace fiducap {

/// Fixed-point text, e.g. fixed(1.2345, 2) == "1.23".
[[nodiscard]] std::string fixed(double value, int decimals);
/// The shortest text that reads back as the same number.
[[nodiscard]] std::string shortest(double value);

/// The whole text as a number. @return false for any other text
template <typename Number>
[[nodiscard]] bool parse_number(std::string_view text, Number& out) {
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, out);
  return error == std::errc() && stop == end;
}

/// `a, b, c`. @param to_text  of one item
template <typename Range, typename ToText = std::identity>
[[nodiscard]] std::string comma_list(const Range& range, ToText to_text = {}) {
  std::string all;
  for (const auto& item : range) all.append(all.empty() ? "" : ", ").append(to_text(item));
  return all;
}

/// Text from outside for a log, a message or a terminal, which it must not control: escapes control
/// characters (also U+0080 to U+009F) and bytes that are not UTF-8 as `\x1b`; the rest stays.
[[nodiscard]] std::string printable(std::string_view text);
/// The same, of at most `most` bytes as shown; then `...` where characters are left out.
[[nodiscard]] std::string printable(std::string_view text, std::size_t most);

/// Compares in constant time. An empty secret is equal to nothing.
[[nodiscard]] bool same_secret(std::string_view given, std::string_view secret);

/// Removes the first UTF-8 character. Strict, as RFC 3629: no overlong form, no surrogate.
/// @return nullopt when the text does not begin with a character; then its first byte is removed
/// @pre !text.empty()
[[nodiscard]] std::optional<char32_t> take_character(std::string_view& text);

/// The known word with the smallest edit distance; case is ignored; `-`, `_` and blanks are equal.
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
