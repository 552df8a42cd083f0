#pragma once

#include <memory>

#include "capture/camera_frame.hpp"
#include "detection/detector_config.hpp"

namespace fiducap {

/// Finds AprilTags in gray images.
///
/// Keeps nothing between images. One instance per thread: building it is slow (family tables), detecting is not.
/// Method: E. Olson, "AprilTag: a robust and flexible visual fiducial system", ICRA 2011; library apriltag 3.
class TagDetector final {
 public:
  /// @pre tags.check().empty() && config.check().empty()
  TagDetector(const TagSetConfig& tags, const DetectorConfig& config);
  ~TagDetector();
  TagDetector(TagDetector&&) noexcept;
  TagDetector& operator=(TagDetector&&) noexcept;

  /// @return one sighting per decoded tag, sorted by id; an id printed twice comes twice (`observe` drops both).
  ///         Empty is a normal answer. Never throws for image content.
  [[nodiscard]] CornerFrame detect(const CameraFrame& frame);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
