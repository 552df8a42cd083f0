#pragma once

#include <span>
#include <string>
#include <string_view>

namespace fiducap {

/// What is known of a tag family without making it. docs/design/tag-families.md has the table.
struct TagFamilyFacts {
  std::string_view name;  ///< As configurations, recordings and maps write it.
  int edge_modules;       ///< Along the edge that `size_m` is, from corner to corner.
  /// Bits that may be corrected, at most: more would read tags where there are none, or fill
  /// memory with the table of what is nearly a tag.
  int most_corrected;
  /// Decision margin below which too much is read where nothing is; 0: none beyond the detector's.
  double least_margin;
  bool is_weak;    ///< Read where nothing is, or one id for another, all the same.
  int dictionary;  ///< Number of OpenCV's ArUco dictionary; −1: the family is libapriltag's.
};

/// All that can be printed and read.
[[nodiscard]] std::span<const TagFamilyFacts> tag_families();

/// Small and capital letters, `-`, `_` and blanks are the same; `4x4_50` and `aruco_4x4_50` are
/// `DICT_4X4_50`. Allocates nothing for a name as it is written in the list.
/// @return nullptr for an unknown one
[[nodiscard]] const TagFamilyFacts* find_tag_family(std::string_view name);

[[nodiscard]] inline bool is_tag_family(std::string_view name) {
  return find_tag_family(name) != nullptr;
}
/// The name as the list writes it, so that names can be compared; unknown ones stay.
[[nodiscard]] std::string listed_tag_family(std::string name);

/// For messages: all names, comma separated.
[[nodiscard]] std::string tag_family_names();
/// For messages: `must be one of …`, and which one may have been meant.
[[nodiscard]] std::string tag_family_rule(std::string_view name);
/// Why another family would be better; empty for a good one.
[[nodiscard]] std::string tag_family_warning(std::string_view name);

}  // namespace fiducap
