#pragma once

#include <vector>

#include "detection/other_families.hpp"
#include "unit/detection/drawn_tag.hpp"

namespace fiducap {

/// Kalibr's AprilGrid, upright: black squares join the corners of the tags, ids from the lower
/// left.
struct DrawnGrid {
  static constexpr int kTagCells = 10;

  int columns{6};
  int rows{6};
  int gap_cells{3};  ///< Between tags, of the 10 cells of a tag's edge.
  int cell_px{4};
  int first_id{0};

  [[nodiscard]] int width_px() const {
    return (columns * (kTagCells + gap_cells) + gap_cells) * cell_px;
  }
  [[nodiscard]] int height_px() const {
    return (rows * (kTagCells + gap_cells) + gap_cells) * cell_px;
  }
  /// Of the tag's upper left corner, from the upper left of the grid.
  [[nodiscard]] int left_px(int column) const {
    return (gap_cells + column * (kTagCells + gap_cells)) * cell_px;
  }
  [[nodiscard]] int top_px(int row) const { return left_px(rows - 1 - row); }

  void draw(GrayImage& image, int left, int top) const {
    const TagFamily family = TagFamily::named(kAprilGridFamily).value();
    const int step = (kTagCells + gap_cells) * cell_px;
    for (int row = 0; row <= rows; ++row)
      for (int column = 0; column <= columns; ++column)
        draw_square(image, left + column * step, top + row * step, gap_cells * cell_px, 20);
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column)
        draw_cells(image, family.cells(first_id + row * columns + column), family.width(),
                   left + left_px(column), top + top_px(row));
  }

 private:
  /// Without the white ring around the black border.
  void draw_cells(GrayImage& image, const std::vector<std::uint8_t>& cells, int width, int left,
                  int top) const {
    for (int v = 0; v < kTagCells; ++v)
      for (int u = 0; u < kTagCells; ++u)
        draw_square(image, left + u * cell_px, top + v * cell_px, cell_px,
                    cells[static_cast<std::size_t>((v + 1) * width + u + 1)] == 0 ? 20 : 220);
  }
};

}  // namespace fiducap
