#pragma once

#include <string>
#include <type_traits>
#include <variant>
#include <vector>

namespace fiducap::bench {

/// A number with the digits it is printed with; NaN is printed as a dash.
struct Figure {
  double value{};
  int decimals{2};
};
using Cell = std::variant<std::string, Figure>;

/// Printed as text or, for scripts, as JSON.
struct Table {
  std::string title;
  std::vector<std::string> columns;
  std::vector<std::vector<Cell>> rows{};
  std::vector<std::string> remarks{};
};

/// A row; integers become text.
template <typename... Values>
[[nodiscard]] std::vector<Cell> cells(const Values&... values) {
  const auto cell = []<typename Value>(const Value& value) -> Cell {
    if constexpr (std::is_integral_v<Value>) {
      return std::to_string(value);
    } else {
      return value;
    }
  };
  return {cell(values)...};
}

/// Names between `|`.
[[nodiscard]] std::vector<std::string> split(const std::string& names);
/// @return aligned text, a blank line after it
[[nodiscard]] std::string to_text(const Table& table);
/// @return one JSON array: {title, rows: [{column: value}], remarks}; a column "/x" is named after
/// the one it belongs to
[[nodiscard]] std::string to_json(const std::vector<Table>& tables);

}  // namespace fiducap::bench
