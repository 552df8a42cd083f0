#pragma once

#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "base/whole_file.hpp"
#include "support/results.hpp"

namespace fiducap {

using CsvRow = std::vector<std::string>;

/// Changes the rows of a table of a recording; its header stays.
inline void change_csv(const std::string& path,
                       const std::function<void(std::vector<CsvRow>&)>& change) {
  const std::string text = content_of(path);
  std::vector<CsvRow> rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream fields(line);
    rows.emplace_back();
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
  }
  change(rows);
  std::string changed = text.substr(0, text.find('\n') + 1);
  for (const CsvRow& row : rows) {
    for (const std::string& field : row) changed += (&field == &row[0] ? "" : ",") + field;
    changed += '\n';
  }
  value_of(write_whole_file(path, changed));
}

/// Changes every row.
inline auto each_row(const std::function<void(CsvRow&)>& change) {
  return [change](std::vector<CsvRow>& rows) {
    for (CsvRow& row : rows) change(row);
  };
}

}  // namespace fiducap
