#include "base/text.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdio>
#include <vector>

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

// Longer texts are not compared: the distance costs the product of the lengths.
constexpr std::size_t kLongest = 64;

std::string folded(std::string_view word) {
  std::string out;
  for (const char c : word) {
    const auto letter = static_cast<unsigned char>(c);
    out += c == '-' || c == ' ' ? '_' : static_cast<char>(std::tolower(letter));
  }
  return out;
}

/// Optimal string alignment distance (Damerau and Levenshtein, neighbours swapped at most once).
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), now(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    now[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t other = a[i - 1] == b[j - 1] ? 0 : 1;
      now[j] = std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + other});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) now[j] = std::min(now[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(now);
  }
  return last[b.size()];
}

/// `size` for `size_m`, `rate_hz` for `rate_s`: the unit is missing or another one.
bool differs_by_its_unit(const std::string& written, const std::string& known) {
  constexpr std::size_t kShortest = 3;
  const auto stem = known.substr(0, known.rfind('_'));
  return stem.size() >= kShortest && stem.size() < known.size() &&
         (written == stem || written.starts_with(stem + "_"));
}

}  // namespace

std::string fixed(double value, int decimals) {
  std::array<char, 352> text{};  // the longest double has 309 digits before the point
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string shortest(double value) {
  std::array<char, 40> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

std::string printable(std::string_view text) { return printable(text, std::string::npos); }

std::string printable(std::string_view text, std::size_t most) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string out;
  out.reserve(std::min(text.size(), most));
  while (!text.empty()) {
    const std::size_t shown = out.size();
    const std::string_view from = text;
    const auto character = take_character(text);
    const std::string_view bytes = from.substr(0, from.size() - text.size());
    const bool is_control =
        !character || *character < 0x20 || (*character >= 0x7f && *character < 0xa0);
    if (!is_control) out += bytes;
    for (const char c : is_control ? bytes : std::string_view()) {
      const auto byte = static_cast<unsigned char>(c);
      out += "\\x";
      out += kDigits[byte >> 4];
      out += kDigits[byte & 15];
    }
    if (out.size() > most) return out.replace(shown, std::string::npos, "...");
  }
  return out;
}

bool same_secret(std::string_view given, std::string_view secret) {
  if (secret.empty() || given.size() != secret.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < given.size(); ++i)
    difference |= byte_at(given, i) ^ byte_at(secret, i);
  return difference == 0;
}

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
  const bool overlong = c < (bytes == 4 ? 0x10000U : bytes == 3 ? 0x800U : 0x80U);
  if (overlong || surrogate || c > kLastCharacter) return std::nullopt;
  text = from.substr(bytes);
  return c;
}

std::optional<std::string> closest_word(std::string_view written,
                                        std::span<const std::string> known) {
  if (written.empty() || written.size() > kLongest) return std::nullopt;
  const std::string word = folded(written);
  std::optional<std::string> best;
  std::size_t least = 1 + std::max<std::size_t>(1, word.size() / 3);
  for (const std::string& candidate : known) {
    if (candidate.size() > kLongest) continue;
    const std::string other = folded(candidate);
    const std::size_t far = differs_by_its_unit(word, other) ? 1 : distance(word, other);
    if (far >= least || far >= other.size()) continue;
    least = far;
    best = candidate;
  }
  return best;
}

std::string did_you_mean(std::string_view written, std::span<const std::string> known) {
  const auto word = closest_word(written, known);
  return word ? "did you mean " + *word + "?" : "";
}

std::string must_be_one_of(std::span<const std::string> known, std::string_view written) {
  const std::string rule = "must be one of " + comma_list(known);
  const std::string meant = did_you_mean(written, known);
  return meant.empty() ? rule : rule + "; " + meant;
}

}  // namespace fiducap
