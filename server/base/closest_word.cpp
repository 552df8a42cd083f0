#include "base/closest_word.hpp"

#include <algorithm>
#include <cctype>

namespace fiducap {

namespace {

// Longer ones are no words, and the distance costs the product of the lengths.
constexpr std::size_t kLongest = 64;

std::string folded(std::string_view word) {
  std::string out;
  for (const char c : word) {
    const auto letter = static_cast<unsigned char>(c);
    out += c == '-' || c == ' ' ? '_' : static_cast<char>(std::tolower(letter));
  }
  return out;
}

/// Optimal string alignment (Damerau and Levenshtein, neighbours swapped at most once).
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

/// `size` for `size_m`, `rate` for `rate_hz`: the unit was forgotten, or another one written.
bool is_the_same_but_for_its_unit(const std::string& written, const std::string& known) {
  constexpr std::size_t kShortest = 3;
  const auto stem = known.substr(0, known.rfind('_'));
  return stem.size() >= kShortest && stem.size() < known.size() &&
         (written == stem || written.starts_with(stem + "_"));
}

}  // namespace

std::optional<std::string> closest_word(std::string_view written,
                                        std::span<const std::string> known) {
  if (written.empty() || written.size() > kLongest) return std::nullopt;
  const std::string word = folded(written);
  std::optional<std::string> best;
  std::size_t least = 1 + std::max<std::size_t>(1, word.size() / 3);
  for (const std::string& candidate : known) {
    if (candidate.size() > kLongest) continue;
    const std::string other = folded(candidate);
    const std::size_t far = is_the_same_but_for_its_unit(word, other) ? 1 : distance(word, other);
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
  std::string rule = "must be one of ";
  for (const std::string& word : known) rule += (&word == &known.front() ? "" : ", ") + word;
  const std::string meant = did_you_mean(written, known);
  return meant.empty() ? rule : rule + "; " + meant;
}

}  // namespace fiducap
