#pragma once

#include <string>

#include "base/expected.hpp"
#include "calibration/intrinsics/calibration_data.hpp"
#include "tools/calibrate/board_description.hpp"

namespace fiducap {

/// What to take from a file of corners.
struct CornerFileChoice {
  std::string path;
  int width{};
  int height{};
  int camera{0};    ///< Of the column `camera`; without such a column all rows are of one camera.
  std::string set;  ///< Of the column `set`; empty: the file has one or no such column.
  BoardDescription board;
};

/// Corners that another program found. CSV with a line of column names, in any order; others are
/// left alone:
///
///     image,tag,corner,u,v      corner 0 … 3: bottom left, bottom right, top right, top left
///     image,tag,blx,bly,brx,bry,trx,try,tlx,tly
///     image,point,u,v           point of a board, row by row
///
/// and `camera`, `set` where a file holds several. Pixels: (0, 0) is the centre of the upper-left
/// one. Also known as: `frame`, `sync_index` (image), `id` (tag), `keypoint_id` (point), `cam`,
/// `cam_id` (camera), `img_loc_x`, `img_loc_y` (u, v). Rows that cannot be used are counted and
/// logged.
/// @return Error when nothing is left, or when the corners say that the images are mirrored
[[nodiscard]] Expected<CalibrationData> read_corner_file(const CornerFileChoice& choice);

}  // namespace fiducap
