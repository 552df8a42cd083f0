#pragma once

#include <map>
#include <string_view>
#include <vector>

#include "detection/tag_detector.hpp"

namespace fiducap {

/// Chooses among the images of a live camera those that a calibration gains by: sharp, with tags
/// large enough, and not like one that was chosen before.
class PicturePicker final {
 public:
  enum class Verdict { kTaken, kNoTag, kSmeared, kAlike };

  /// @pre tags.check().empty()
  explicit PicturePicker(const TagSetConfig& tags);
  /// kTaken: the image is remembered as chosen.
  [[nodiscard]] Verdict look(const CameraFrame& frame);

 private:
  using Corners = std::map<int, std::array<Eigen::Vector2d, 4>>;
  [[nodiscard]] Corners corners_in(const CameraFrame& frame);

  TagSetConfig tags_;
  std::unique_ptr<TagDetector> detector_;
  std::vector<Corners> taken_;
};

/// For a person who moves the camera: what to do next.
[[nodiscard]] std::string_view advice_for(PicturePicker::Verdict verdict);

}  // namespace fiducap
