#pragma once

#include <string_view>

namespace fiducap::words {

/// What a file calls one value of an enum.
template <typename E>
struct Word {
  std::string_view text;
  E value;
};

}  // namespace fiducap::words
