// Corners of other programs, and their targets: an error, or sightings with points of their target.
#include "fuzz/memory_file.hpp"
#include "tools/calibrate/calibrate.hpp"

FUZZ(corner_file_fuzz, input) {
  static const MemoryFile file;
  const unsigned which = input.choose(4);
  constexpr const char* kBoards[] = {"tags:100", "points:4x3:20", "charuco:5x7:36:18",
                                     "grid:3x2:30:10"};
  const std::string text = input.text();
  CornerFileChoice choice;
  choice.path = file.path();
  choice.width = 640;
  choice.height = 480;
  auto board = read_board_description(kBoards[which]);
  // The first line may describe a board of its own.
  if (const auto own = read_board_description(text.substr(0, text.find('\n')))) board = own;
  require(board.has_value());
  choice.board = *board;
  file.put(text);
  const auto read = read_corner_file(choice);
  if (!read) return;
  for (const CalibrationView& view : read->views)
    for (const TargetSighting& sighting : view.sightings) {
      require(static_cast<std::size_t>(sighting.target) < read->targets.size());
      const auto& points = read->targets[static_cast<std::size_t>(sighting.target)].points;
      for (const SeenPoint& seen : sighting.points)
        require(static_cast<std::size_t>(seen.point) < points.size() && seen.px.allFinite());
    }
}
