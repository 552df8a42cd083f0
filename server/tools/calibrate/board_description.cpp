#include "tools/calibrate/board_description.hpp"

#include <charconv>
#include <optional>
#include <string_view>
#include <vector>

#include "detection/corner_projection.hpp"

namespace fiducap {
namespace {

constexpr int kMostAlong = 100;  // squares along a side

Error board_error(const std::string& text) {
  return {
      ErrorCode::kInvalid,
      "must be tags:MM, points:COLUMNSxROWS:MM, charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM[:white] "
      "or grid:COLUMNSxROWS:TAG_MM:GAP_MM, e.g. charuco:5x7:36.2:18.3 (columns and rows 2 to 100, "
      "lengths > 0); is '" +
          text + "'",
      "--board"};
}

std::vector<std::string_view> split(std::string_view text, char by) {
  std::vector<std::string_view> parts;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(by, at), text.size());
    parts.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return parts;
}

template <typename Number>
std::optional<Number> whole_number(std::string_view text) {
  Number value{};
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

std::optional<double> metres(std::string_view millimetres) {
  constexpr double kLongest_mm = 1e5;
  const auto value = whole_number<double>(millimetres);
  if (!value || !(*value > 0 && *value <= kLongest_mm)) return std::nullopt;
  return *value / 1000;
}

struct Raster {
  int columns{};
  int rows{};
};

std::optional<Raster> raster(std::string_view text) {
  const auto parts = split(text, 'x');
  if (parts.size() != 2) return std::nullopt;
  const auto columns = whole_number<int>(parts[0]);
  const auto rows = whole_number<int>(parts[1]);
  const auto fits = [](const auto& n) { return n && *n >= 2 && *n <= kMostAlong; };
  if (!fits(columns) || !fits(rows)) return std::nullopt;
  return Raster{*columns, *rows};
}

void add_tag(BoardDescription& out, int id, const Eigen::Vector3d& middle, double edge_m) {
  out.first_corner_of_tag[id] = static_cast<int>(out.board.points.size());
  for (int i = 0; i < 4; ++i) out.board.points.push_back(middle + tag_corner(i, edge_m));
}

BoardDescription points_board(const Raster& size, double square_m) {
  BoardDescription out;
  out.board.name = "board of points";
  for (int row = 0; row < size.rows; ++row)
    for (int column = 0; column < size.columns; ++column)
      out.board.points.emplace_back(column * square_m, -row * square_m, 0);
  return out;
}

BoardDescription charuco_board(const Raster& size, double square_m, double marker_m, bool white) {
  BoardDescription out;
  out.board.name = "ChArUco board";
  int id = 0;
  for (int row = 0; row < size.rows; ++row)
    for (int column = 0; column < size.columns; ++column) {
      const bool is_black = (row + column + (white ? 1 : 0)) % 2 == 0;
      if (!is_black)
        add_tag(out, id++, {(column + 0.5) * square_m, -(row + 0.5) * square_m, 0}, marker_m);
    }
  return out;
}

BoardDescription grid_board(const Raster& size, double tag_m, double gap_m) {
  BoardDescription out;
  out.board.name = "grid of tags";
  const double step = tag_m + gap_m;
  for (int row = 0; row < size.rows; ++row)
    for (int column = 0; column < size.columns; ++column)
      add_tag(out, row * size.columns + column, {column * step, -row * step, 0}, tag_m);
  return out;
}

}  // namespace

Expected<BoardDescription> read_board_description(const std::string& text) {
  const auto parts = split(text, ':');
  const auto wrong = [&] { return tl::unexpected(board_error(text)); };
  if (parts[0] == "tags" && parts.size() == 2) {
    const auto edge = metres(parts[1]);
    if (!edge) return wrong();
    BoardDescription tags;
    tags.tag_m = *edge;
    return tags;
  }
  if (parts.size() < 3) return wrong();
  const auto size = raster(parts[1]);
  const auto first = metres(parts[2]);
  if (!size || !first) return wrong();
  if (parts[0] == "points" && parts.size() == 3) return points_board(*size, *first);
  if (parts.size() < 4) return wrong();
  const auto second = metres(parts[3]);
  if (!second) return wrong();
  if (parts[0] == "grid" && parts.size() == 4) return grid_board(*size, *first, *second);
  const bool white = parts.size() == 5 && parts[4] == "white";
  if (parts[0] != "charuco" || (parts.size() != 4 && !white) || !(*second < *first)) return wrong();
  return charuco_board(*size, *first, *second, white);
}

}  // namespace fiducap
