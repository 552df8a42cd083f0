#include <optional>
#include <string_view>
#include <vector>

#include "base/yaml_section.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording_layout.hpp"
#include "detection/tag_family.hpp"
#include "detection/tag_geometry.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

constexpr int kMostAlong = 100;  // squares along a side

std::vector<std::string_view> split(std::string_view text, char by) {
  std::vector<std::string_view> parts;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(by, at), text.size());
    parts.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return parts;
}

std::optional<double> metres(std::string_view millimetres) {
  constexpr double kLongest_mm = 1e5;
  double value = 0;
  if (!parse_number(millimetres, value) || !(value > 0 && value <= kLongest_mm))
    return std::nullopt;
  return value / 1000;
}

struct Raster {
  int columns{}, rows{};
};

std::optional<Raster> raster(std::string_view text) {
  const auto size = pair_from(text);
  const auto fits = [](int n) { return n >= 2 && n <= kMostAlong; };
  if (!size || !fits(size->first) || !fits(size->second)) return std::nullopt;
  return Raster{size->first, size->second};
}

void add_tag(BoardDescription& out, int id, const Eigen::Vector3d& middle, double edge_m) {
  out.first_corner_of_tag[id] = static_cast<int>(out.board.points.size());
  for (int i = 0; i < 4; ++i) out.board.points.push_back(middle + tag_corner(i, edge_m));
}

BoardDescription points_board(const Raster& size, double square_m) {
  BoardDescription out;
  out.checkerboard = {size.columns, size.rows, square_m};
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

/// Kalibr's ratio of gap to edge.
bool is_spacing(double spacing) { return spacing > 0 && spacing <= 2; }

bool fits_family(const Raster& size, int first_id) {
  return first_id >= 0 &&
         first_id + size.columns * size.rows <= TagFamily::named("tag36h11")->ids();
}

/// Numbered from the lower left, as Kalibr does.
BoardDescription april_grid(const Raster& size, double tag_m, double spacing, int first_id) {
  BoardDescription out;
  out.board.name = "AprilGrid";
  out.is_april_grid = true;
  const double step = tag_m * (1 + spacing);
  for (int row = 0; row < size.rows; ++row)
    for (int column = 0; column < size.columns; ++column)
      add_tag(out, first_id + row * size.columns + column, {column * step, row * step, 0}, tag_m);
  return out;
}

/// @return {} with a fault when the numbers are impossible
Raster raster_of(const YamlSection& file, const std::string& columns, const std::string& rows) {
  const Raster size{file.required_integer(columns), file.required_integer(rows)};
  for (const auto& [key, n] : {std::pair(columns, size.columns), std::pair(rows, size.rows)})
    if (n < 1 || n > kMostAlong) file.add_fault(key, "must be 1 to " + std::to_string(kMostAlong));
  return size;
}

double length_of(const YamlSection& file, const std::string& key) {
  const double length_m = file.required_number(key);
  if (!(length_m > 0 && length_m <= 100)) file.add_fault(key, "must be above 0 and at most 100 m");
  return length_m;
}

BoardDescription april_grid_of(const YamlSection& file) {
  const Raster size = raster_of(file, "tagCols", "tagRows");
  const double tag_m = length_of(file, "tagSize");
  const double spacing = file.required_number("tagSpacing");
  const int first_id = file.integer("codeOffset").value_or(0);
  if (!is_spacing(spacing))
    file.add_fault("tagSpacing", "must be the gap relative to tagSize, above 0 and at most 2");
  const auto faultless = file.check();
  if (faultless && !fits_family(size, first_id))
    file.add_fault("tagCols", "and tagRows need more ids than tag36h11 has");
  return file.check() ? april_grid(size, tag_m, spacing, first_id) : BoardDescription{};
}

BoardDescription checkerboard_of(const YamlSection& file) {
  const Raster size = raster_of(file, "targetCols", "targetRows");
  const double square_m = length_of(file, "rowSpacingMeters");
  if (file.required_number("colSpacingMeters") != square_m)
    file.add_fault("colSpacingMeters", "must equal rowSpacingMeters: squares");
  return file.check() ? points_board(size, square_m) : BoardDescription{};
}

}  // namespace

Expected<BoardDescription> read_board_description(const std::string& text) {
  const auto parts = split(text, ':');
  const auto wrong = [&] {
    return fail(
        ErrorCode::kInvalid,
        "must be tags:MM, points:COLUMNSxROWS:MM, "
        "charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM[:white], grid:COLUMNSxROWS:TAG_MM:GAP_MM "
        "or aprilgrid:COLUMNSxROWS:TAG_MM:SPACING, e.g. charuco:5x7:36.2:18.3 or "
        "aprilgrid:6x6:88:0.3 (columns and rows 2 to 100, lengths > 0), or a file: Kalibr's "
        "target.yaml; is '" +
            text + "'",
        "--board");
  };
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
  if (parts[0] == "aprilgrid" && parts.size() == 4) {
    double spacing = 0;
    const bool is_possible = parse_number(parts[3], spacing) && is_spacing(spacing);
    if (!is_possible || !fits_family(*size, 0)) return wrong();
    return april_grid(*size, *first, spacing, 0);
  }
  const auto second = metres(parts[3]);
  if (!second) return wrong();
  if (parts[0] == "grid" && parts.size() == 4) return grid_board(*size, *first, *second);
  const bool white = parts.size() == 5 && parts[4] == "white";
  if (parts[0] != "charuco" || (parts.size() != 4 && !white) || !(*second < *first)) return wrong();
  return charuco_board(*size, *first, *second, white);
}

Expected<BoardDescription> read_board(const std::string& text) {
  if (!is_file(text)) return read_board_description(text);
  const auto file = YamlSection::load(text);
  if (!file) return tl::unexpected(file.error());
  const bool is_unnamed_grid = !file->has("target_type") && file->has("tagCols");
  const std::string type = is_unnamed_grid ? "aprilgrid" : file->text("target_type").value_or("");
  if (type != "aprilgrid" && type != "checkerboard")
    return fail(ErrorCode::kUnsupported,
                "target_type must be aprilgrid or checkerboard, is '" + type +
                    "': print an AprilGrid, a checkerboard, or a sheet of `fiducap tags sheet`",
                text);
  BoardDescription board = type == "aprilgrid" ? april_grid_of(*file) : checkerboard_of(*file);
  return file->check().map([&] { return std::move(board); });
}

}  // namespace fiducap
