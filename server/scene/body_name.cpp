#include "scene/body_name.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "base/text.hpp"

namespace fiducap {

namespace {

struct Range {
  char32_t first;
  char32_t last;
};

bool is_ascii_of_names(char32_t c) {
  const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
  const bool digit = c >= '0' && c <= '9';
  return letter || digit || std::u32string_view(U" _-.+()").find(c) != std::u32string_view::npos;
}

template <std::size_t N>
bool is_in(char32_t c, const std::array<Range, N>& ranges) {
  return std::ranges::any_of(
      ranges, [c](const Range& range) { return c >= range.first && c <= range.last; });
}

// The Unicode Standard: C0; C1; soft hyphen; Arabic letter mark; fillers; Mongolian separator; zero
// width, direction; separators, embeddings, overrides; word joiner to isolates, old formats;
// private use; noncharacters; selectors; byte order mark; annotations; tags and beyond.
constexpr std::array<Range, 16> kInvisible{{{0x00, 0x1f},
                                            {0x7f, 0x9f},
                                            {0xad, 0xad},
                                            {0x61c, 0x61c},
                                            {0x115f, 0x1160},
                                            {0x180b, 0x180f},
                                            {0x200b, 0x200f},
                                            {0x2028, 0x202e},
                                            {0x2060, 0x206f},
                                            {0x3164, 0x3164},
                                            {0xe000, 0xf8ff},
                                            {0xfdd0, 0xfdef},
                                            {0xfe00, 0xfe0f},
                                            {0xfeff, 0xfeff},
                                            {0xfff0, 0xffff},
                                            {0xe0000, 0x10ffff}}};
constexpr std::array<Range, 6> kOtherSpaces{{{0xa0, 0xa0},
                                             {0x1680, 0x1680},
                                             {0x2000, 0x200a},
                                             {0x202f, 0x202f},
                                             {0x205f, 0x205f},
                                             {0x3000, 0x3000}}};
constexpr std::array<Range, 5> kMarks{
    {{0x300, 0x36f}, {0x1ab0, 0x1aff}, {0x1dc0, 0x1dff}, {0x20d0, 0x20ff}, {0xfe20, 0xfe2f}}};
// They look like ASCII that is not allowed: quotes, slashes, full-width forms.
constexpr std::array<Range, 6> kLookalikes{{{0xab, 0xab},
                                            {0xbb, 0xbb},
                                            {0x2018, 0x201f},
                                            {0x2039, 0x203a},
                                            {0x2044, 0x2044},
                                            {0xff01, 0xff5e}}};

std::string code_of(char32_t c) { return fmt::format("U+{:04X}", static_cast<unsigned>(c)); }

std::optional<std::string> character_fault(char32_t c) {
  if (is_in(c, kInvisible)) return "must not have invisible characters, has " + code_of(c);
  if (c < 0x80) {
    if (is_ascii_of_names(c)) return std::nullopt;
    return std::string("must not have ") + static_cast<char>(c) +
           ": letters, digits, spaces and _ - . + ( ) are allowed";
  }
  if (is_in(c, kOtherSpaces)) return "must have no other space than U+0020, has " + code_of(c);
  if (is_in(c, kMarks))
    return "must have composed letters (ä) instead of combining marks, has " + code_of(c);
  if (is_in(c, kLookalikes))
    return "must not have characters that look like quotes or signs, has " + code_of(c);
  return std::nullopt;
}

}  // namespace

std::optional<std::string> body_name_fault(std::string_view name) {
  if (name.empty()) return "must not be empty";
  if (name.size() > kMaxBodyName)
    return fmt::format(
        "must have at most {} bytes, has {} (an ASCII letter takes 1, others 2 to 4)", kMaxBodyName,
        name.size());
  for (std::string_view left = name; !left.empty();) {
    const auto c = take_character(left);
    if (!c) return "must be UTF-8, has bytes that are not";
    if (auto fault = character_fault(*c)) return fault;
  }
  if (name.front() == ' ' || name.back() == ' ') return "must not begin or end with a space";
  if (name.find("  ") != std::string_view::npos) return "must not have two spaces in a row";
  if (name.front() == '.' || name.front() == '-')
    return "must not begin with . or -: hidden files and options do";
  return std::nullopt;
}

std::string shown_name(std::string_view name) {
  std::string shown = "\"";
  while (!name.empty()) {
    const std::string_view before = name;
    const auto c = take_character(name);
    const auto bytes = before.substr(0, before.size() - name.size());
    if (!c) {
      shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(bytes.front()));
    } else if (is_in(*c, kInvisible) || is_in(*c, kOtherSpaces)) {
      const auto code = static_cast<unsigned>(*c);
      shown += *c < 0x80 ? fmt::format("\\x{:02x}", code) : fmt::format("\\u{:04x}", code);
    } else {
      shown += bytes;
    }
  }
  return shown + '"';
}

}  // namespace fiducap
