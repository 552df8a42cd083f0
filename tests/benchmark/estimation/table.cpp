#include "estimation/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

namespace fiducap::bench {

namespace {

std::string text_of(const Cell& cell) {
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  const auto& figure = std::get<Figure>(cell);
  return std::isnan(figure.value) ? "-" : fmt::format("{:.{}f}", figure.value, figure.decimals);
}

/// Letters, not bytes: units and names are UTF-8.
std::size_t letters(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0) != 0x80;
  }));
}

std::string right_aligned(const std::string& text, std::size_t width) {
  return std::string(width - std::min(width, letters(text)), ' ') + text + "  ";
}

nlohmann::json json_of(const Cell& cell) {
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  const double value = std::get<Figure>(cell).value;
  if (!std::isfinite(value)) return nullptr;
  return value;
}

/// "/bound" after "pos" is "pos/bound": keys are unique where columns are not.
std::string key_of(const Table& table, std::size_t column) {
  std::size_t named = column;
  while (named > 0 && table.columns[named].starts_with('/')) --named;
  return named == column ? table.columns[column] : table.columns[named] + table.columns[column];
}

}  // namespace

std::vector<std::string> split(const std::string& names) {
  std::vector<std::string> out;
  std::istringstream stream(names);
  for (std::string name; std::getline(stream, name, '|');) out.push_back(name);
  return out;
}

std::string to_text(const Table& table) {
  std::vector<std::size_t> widths;
  for (const std::string& column : table.columns) widths.push_back(letters(column));
  for (const auto& row : table.rows) {
    for (std::size_t c = 0; c < row.size(); ++c)
      widths[c] = std::max(widths[c], letters(text_of(row[c])));
  }
  std::string out = table.title + "\n";
  for (std::size_t c = 0; c < widths.size(); ++c) out += right_aligned(table.columns[c], widths[c]);
  out += "\n";
  for (const auto& row : table.rows) {
    for (std::size_t c = 0; c < row.size(); ++c) out += right_aligned(text_of(row[c]), widths[c]);
    out += "\n";
  }
  for (const std::string& remark : table.remarks) out += "  " + remark + "\n";
  return out + "\n";
}

std::string to_json(const std::vector<Table>& tables) {
  nlohmann::json out = nlohmann::json::array();
  for (const Table& table : tables) {
    nlohmann::json rows = nlohmann::json::array();
    for (const auto& row : table.rows) {
      nlohmann::json one;
      for (std::size_t c = 0; c < row.size(); ++c) one[key_of(table, c)] = json_of(row[c]);
      rows.push_back(std::move(one));
    }
    out.push_back({{"title", table.title}, {"rows", rows}, {"remarks", table.remarks}});
  }
  return out.dump(1);
}

}  // namespace fiducap::bench
