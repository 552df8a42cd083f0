#include "base/text.hpp"

#include <array>
#include <charconv>
#include <cstdio>

namespace fiducap {

std::string fixed(double value, int decimals) {
  std::array<char, 352> text{};  // the longest double has 309 digits before the point
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string shortest(double value) {
  std::array<char, 40> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

}  // namespace fiducap
