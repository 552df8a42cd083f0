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

/// What is to be looked for.
struct CalibrationTargets {
  std::optional<Checkerboard> checkerboard;  ///< Else tags.
  TagSetConfig tags;
};

/// Looks for the targets in images of one size. Tags whose sides are shorter than 20 px are left
/// out: their corners are worse than those of others, and they are near enough elsewhere.
class ViewCollector final {
 public:
  explicit ViewCollector(CalibrationTargets targets);

  /// @param name  of the image, for people
  /// @return nullopt: there is no target in it
  [[nodiscard]] std::optional<CalibrationView> look(const std::string& name,
                                                    const std::shared_ptr<const GrayImage>& image);
  /// The same for tags that were found already.
  [[nodiscard]] std::optional<CalibrationView> look(const std::string& name,
                                                    const CornerFrame& corners);
  /// Those of all views so far.
  [[nodiscard]] const std::vector<CalibrationTarget>& targets() const { return seen_; }

 private:
  [[nodiscard]] std::optional<CalibrationView> look_for_checkerboard(const std::string& name,
                                                                     const GrayImage& image) const;
  [[nodiscard]] TagDetector& detector_for(const GrayImage& image);
  [[nodiscard]] bool is_good(const CornerFrame& frame, const TagSighting& tag) const;
  [[nodiscard]] int target_of(int tag_id, bool fitted_sides);

  CalibrationTargets targets_;
  std::optional<TagDetector> detector_;
  std::map<int, int> target_of_tag_;
  std::vector<CalibrationTarget> seen_;
};

/// How far the corners that both views see are apart, mean, in image widths; 1 when there are none.
[[nodiscard]] double distance(const CalibrationView& a, const CalibrationView& b, int width);

/// The sharp ones among the views, and of those up to `most` that differ from each other as much as
/// they can: a hundred images of a camera at rest are one image.
[[nodiscard]] CalibrationData select_views(const CalibrationData& all, std::size_t most);

}  // namespace fiducap
