#pragma once

#include <map>
#include <string>

#include "base/expected.hpp"
#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// What a file of corners speaks of.
struct BoardDescription {
  /// One flat target at known places. No points: tags that stand anywhere, each by itself.
  CalibrationTarget board;
  /// Index in `board.points` of corner 0 (bottom left) of each tag; the other three follow.
  std::map<int, int> first_corner_of_tag;
  double tag_m{0.1};  ///< Edge of tags that stand anywhere.

  [[nodiscard]] bool is_board() const { return !board.points.empty(); }
  /// True: rows name tags and corners; false: rows name points.
  [[nodiscard]] bool has_tags() const { return !is_board() || !first_corner_of_tag.empty(); }
};

/// `tags:MM` – tags of this edge, anywhere, standing still.
/// `points:COLUMNSxROWS:MM` – inner corners of a checkerboard or ChArUco board, numbered row by
/// row. `charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM[:white]` – the markers of a ChArUco board,
/// counted in squares; numbered from the upper left. `white`: the upper left square is white
/// (OpenCV before 4.7, boards with an even number of rows). `grid:COLUMNSxROWS:TAG_MM:GAP_MM` –
/// tags in rows, numbered from the upper left (ArUco GridBoard).
/// @return Error that says what was expected
[[nodiscard]] Expected<BoardDescription> read_board_description(const std::string& text);

}  // namespace fiducap
