#pragma once

#include <vector>

#include "capture/camera_frame.hpp"
#include "detection/tag_detector.hpp"

namespace fiducap {

/// Finds the tags of Kalibr's AprilGrid: tag36h11 with a border of two cells, whose corners touch
/// black squares (kAprilGridFamily).
///
/// The black squares join neighbouring tags into one dark shape, so that no quad is found. A
/// maximum over some pixels separates them; tags are read there, and their corners are searched in
/// the image itself, as saddle points between tag, square and paper. Unlike intersections of sides
/// these are not biased by the lens. One instance per thread.
class AprilGridSearch final {
 public:
  AprilGridSearch();

  /// @return one sighting per tag, sorted by id; an id printed twice occurs twice
  [[nodiscard]] std::vector<TagSighting> find(const GrayImage& image);

 private:
  TagDetector detector_;
};

}  // namespace fiducap
