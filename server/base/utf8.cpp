#include "base/utf8.hpp"

#include <cstddef>

namespace fiducap {

namespace {

constexpr unsigned kFirstOfTwo = 0xc2;  // 0xc0 and 0xc1 would be overlong
constexpr unsigned kFirstOfThree = 0xe0;
constexpr unsigned kFirstOfFour = 0xf0;
constexpr unsigned kLastFirst = 0xf4;
constexpr char32_t kLastCharacter = 0x10ffff;

unsigned byte_at(std::string_view text, std::size_t i) {
  return static_cast<unsigned char>(text[i]);
}

bool is_shortest(char32_t c, std::size_t bytes) {
  return c >= (bytes == 4 ? 0x10000U : bytes == 3 ? 0x800U : 0x80U);
}

}  // namespace

std::optional<char32_t> take_character(std::string_view& text) {
  const std::string_view from = text;
  const unsigned first = byte_at(from, 0);
  text.remove_prefix(1);
  if (first < 0x80) return static_cast<char32_t>(first);
  if (first < kFirstOfTwo || first > kLastFirst) return std::nullopt;
  const std::size_t bytes = first >= kFirstOfFour ? 4 : first >= kFirstOfThree ? 3 : 2;
  if (from.size() < bytes) return std::nullopt;
  char32_t c = first & (0x7fU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    const unsigned next = byte_at(from, i);
    if ((next & 0xc0U) != 0x80U) return std::nullopt;
    c = (c << 6U) | (next & 0x3fU);
  }
  const bool surrogate = c >= 0xd800 && c <= 0xdfff;
  if (!is_shortest(c, bytes) || surrogate || c > kLastCharacter) return std::nullopt;
  text = from.substr(bytes);
  return c;
}

}  // namespace fiducap
