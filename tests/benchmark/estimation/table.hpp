#pragma once

#include <string>
#include <variant>
#include <vector>

namespace fiducap::bench {

/// A number with the digits it is printed with; NaN is printed as a dash.
struct Figure {
  double value{};
  int decimals{2};
};
using Cell = std::variant<std::string, Figure>;

/// What the bench says: for people as text, for scripts as JSON.
struct Table {
  std::string title;
  std::vector<std::string> columns;
  std::vector<std::vector<Cell>> rows{};
  std::vector<std::string> remarks{};
};

/// @return aligned text, a blank line after it
[[nodiscard]] std::string to_text(const Table& table);
/// @return one JSON array: {title, rows: [{column: value}], remarks}; a column "/x" is named after
/// the one it belongs to
[[nodiscard]] std::string to_json(const std::vector<Table>& tables);

}  // namespace fiducap::bench
