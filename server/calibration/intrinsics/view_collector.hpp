#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "calibration/intrinsics/calibration_data.hpp"
#include "capture/camera_frame.hpp"
#include "detection/april_grid.hpp"
#include "detection/detector_config.hpp"
#include "detection/tag_detector.hpp"

namespace fiducap {

/// Inner corners of a checkerboard: one less than squares.
struct Checkerboard {
  int columns{};
  int rows{};
  double square_m{};
};

/// A flat target of known shape, or single tags.
struct BoardDescription {
  /// One flat target at known places. No points: single tags at unknown places.
  CalibrationTarget board;
  /// Index in `board.points` of corner 0 (bottom left) of each tag; the other three follow.
  std::map<int, int> first_corner_of_tag;
  double tag_m{0.1};                         ///< Edge of single tags.
  bool is_april_grid{false};                 ///< The tags are Kalibr's.
  std::optional<Checkerboard> checkerboard;  ///< Whose points these are.

  [[nodiscard]] bool is_board() const { return !board.points.empty(); }
  /// True: rows of a file of corners name tags and corners; false: they name points.
  [[nodiscard]] bool has_tags() const { return !is_board() || !first_corner_of_tag.empty(); }
};

/// The targets of a calibration.
struct CalibrationTargets {
  std::optional<Checkerboard> checkerboard;  ///< Nullopt: tags.
  std::optional<BoardDescription> board;     ///< Of tags. Nullopt: at unknown places.
  TagSetConfig tags;
};

/// Finds the targets in images of one size. Skips tags with sides shorter than 20 px, whose corners
/// are less accurate. As long as no tag of the family was seen, tags of Kalibr's AprilGrid are
/// looked for, too, and from then on they are the targets.
class ViewCollector final {
 public:
  explicit ViewCollector(CalibrationTargets targets);

  /// @param name  of the image, for messages
  /// @return nullopt: there is no target in it
  [[nodiscard]] std::optional<CalibrationView> look(const std::string& name,
                                                    const std::shared_ptr<const GrayImage>& image);
  /// The same for detected tags.
  [[nodiscard]] std::optional<CalibrationView> look(const std::string& name,
                                                    const CornerFrame& corners);
  /// The targets of all views so far.
  [[nodiscard]] const std::vector<CalibrationTarget>& targets() const { return seen_; }

 private:
  [[nodiscard]] bool is_good(const CornerFrame& frame, const TagSighting& tag) const;
  [[nodiscard]] int target_of(int tag_id, bool fitted_sides);
  void add_to_board(const TagSighting& tag, TargetSighting& sighting) const;

  CalibrationTargets targets_;
  std::optional<TagDetector> detector_;
  std::optional<AprilGridSearch> april_grid_;
  bool sees_april_grid_{false};
  std::map<int, int> target_of_tag_;
  std::vector<CalibrationTarget> seen_;
};

/// Mean distance of the corners in both views, in image widths; 1 when there are none.
[[nodiscard]] double distance(const CalibrationView& a, const CalibrationView& b, int width);

/// Selects up to `most` sharp views that differ as much as possible: a hundred images of a camera
/// at rest count as one.
[[nodiscard]] CalibrationData select_views(const CalibrationData& all, std::size_t most);

}  // namespace fiducap
