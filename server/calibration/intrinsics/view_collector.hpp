#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "calibration/intrinsics/calibration_data.hpp"
#include "capture/camera_frame.hpp"
#include "detection/detector_config.hpp"
#include "detection/tag_detector.hpp"

namespace fiducap {

/// Inner corners of a checkerboard: one less than squares.
struct Checkerboard {
  int columns{};
  int rows{};
  double square_m{};
};

/// The targets of a calibration.
struct CalibrationTargets {
  std::optional<Checkerboard> checkerboard;  ///< Nullopt: tags.
  TagSetConfig tags;
};

/// Finds the targets in images of one size. Skips tags with sides shorter than 20 px, whose corners
/// are less accurate.
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

  CalibrationTargets targets_;
  std::optional<TagDetector> detector_;
  std::map<int, int> target_of_tag_;
  std::vector<CalibrationTarget> seen_;
};

/// Mean distance of the corners in both views, in image widths; 1 when there are none.
[[nodiscard]] double distance(const CalibrationView& a, const CalibrationView& b, int width);

/// Selects up to `most` sharp views that differ as much as possible: a hundred images of a camera
/// at rest count as one.
[[nodiscard]] CalibrationData select_views(const CalibrationData& all, std::size_t most);

}  // namespace fiducap
