#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// What is printed for one tag: a square of black and white modules, top row first.
struct TagPattern {
  int tag_id{};
  int modules{};  ///< Side of the whole pattern, with its own white ring if the family has one.
  int border_modules{};     ///< Side of the edge between black and white border: what "tag size"
                            ///< measures.
  bool needs_white_ring{};  ///< The outermost modules may be black: one white module more must go
                            ///< around.
  std::vector<bool> black;  ///< modules × modules

  [[nodiscard]] bool black_at(int column, int row) const {
    return black[static_cast<std::size_t>(row * modules + column)];
  }
};

/// @return the patterns in the order of `ids`; Error naming the known families, or the first id the
/// family does not have.
[[nodiscard]] Expected<std::vector<TagPattern>> tag_patterns(const std::string& family,
                                                             const std::vector<int>& ids);

}  // namespace fiducap
