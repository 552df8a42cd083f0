#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

struct Paper {
  std::string name;
  double width_mm{};
  double height_mm{};
};

/// @param name  `a4`, `a3` or `letter`
[[nodiscard]] std::optional<Paper> paper_named(std::string_view name);

/// Which tags to print and how large.
struct TagSheetOrder {
  std::string family{"tag36h11"};
  std::vector<int> ids;
  double size_mm{160};  ///< Edge between black and white border.
  Paper paper;
};

/// "0-3,7" → 0 1 2 3 7. @return Error naming the part that is no id or range; at most 10000 ids,
/// without repetitions
[[nodiscard]] Expected<std::vector<int>> parse_id_list(std::string_view text);

/// As many tags per page as fit; each with its white zone of at least one cell, and outside of it
/// cut marks, id, family, size and an arrow to its upper edge; per page a ruler of 100 mm.
/// @return the PDF; Error when a tag does not fit, with the largest size that does
[[nodiscard]] Expected<std::string> tag_sheet_pdf(const TagSheetOrder& order);

/// First words of tag_sheet_yaml.
inline constexpr std::string_view kTagSheetHeading = "# Made with the sheet beside this file.";
/// The server's `tags:` section with the sizes of these ids, to be completed with surveyed poses.
[[nodiscard]] std::string tag_sheet_yaml(const TagSheetOrder& order);

}  // namespace fiducap
