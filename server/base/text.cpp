#include "base/text.hpp"

#include <array>
#include <cstdio>

namespace fiducap {

std::string fixed(double value, int decimals) {
  std::array<char, 352> text{};  // the longest double has 309 digits before the point
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

}  // namespace fiducap
