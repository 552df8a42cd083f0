#pragma once

#include <memory>
#include <vector>

#include "capture/camera_frame.hpp"
#include "detection/detector_config.hpp"

namespace fiducap {

/// Pixels [left, right) × [top, bottom) of an image.
struct ImageRegion {
  int left{}, top{}, right{}, bottom{};

  [[nodiscard]] int width() const { return right - left; }
  [[nodiscard]] int height() const { return bottom - top; }
  bool operator==(const ImageRegion&) const = default;
};

[[nodiscard]] inline ImageRegion whole(const GrayImage& image) {
  return {0, 0, image.width, image.height};
}

/// Parameters of one search.
struct DetectionPass {
  double decimate{1.0};  ///< Quads are searched in every n-th pixel, corners refined in all.
  int contrast{5};       ///< Neighbourhoods of 12 × 12 pixels with a smaller range are skipped.
};

/// Finds AprilTags in gray images.
///
/// Keeps nothing between images. One instance per thread: building it is slow (family tables),
/// detecting is not. Method: E. Olson, "AprilTag: a robust and flexible visual fiducial system",
/// ICRA 2011; library apriltag 3.
class TagDetector final {
 public:
  /// @pre tags.check().empty() && config.check().empty()
  TagDetector(const TagSetConfig& tags, const DetectorConfig& config);
  ~TagDetector();
  TagDetector(TagDetector&&) noexcept;
  TagDetector& operator=(TagDetector&&) noexcept;

  /// @return one sighting per decoded tag, sorted by id; an id printed twice occurs twice
  /// (`observe` drops both). May be empty. Never throws for image content.
  [[nodiscard]] CornerFrame detect(const CameraFrame& frame);

  /// Searches a part of the image, in place, and appends the tags found to `out`, in pixels of the
  /// whole image. Skips tags closer than 5 px to the border of the region: they may be cut, with
  /// corners that are pixels off.
  /// @pre the region lies in the image
  void detect(const GrayImage& image, const ImageRegion& region, const DetectionPass& pass,
              std::vector<TagSighting>& out);

  /// Width of bits and quiet zone outside of the family's black border, relative to its edge.
  [[nodiscard]] double outer_ring() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
  DetectorConfig config_;
};

}  // namespace fiducap
