#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "detection/tag_detector.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// Prediction of a tag in the image that is searched next; input of TagSearch.
struct ExpectedTag {
  int tag_id{};
  TagCorners corners_px{};  ///< Raw (distorted) pixels; may lie outside of the image.
  double sigma_px{};        ///< 1-sigma of each coordinate.
  bool known{true};         ///< False: seen before, but without a known pose.
};

/// A part of the image that is searched in one call.
struct SearchRegion {
  ImageRegion pixels;
  int decimate{1};

  /// In pixels of full resolution: the library's time is proportional to the decimated pixels.
  [[nodiscard]] double cost() const;
};

struct RegionRules {
  double outer_ring{0.125};  ///< Of the family, see TagDetector.
  double sigmas{3.0};        ///< Largest error of a prediction.
  /// Smallest distance between opposite sides, in pixels after decimation. From 13 on no tag of
  /// rendered images is missed. Corners are fitted at full resolution (`side_fit`).
  double decimated_width_px{16};
  int max_decimate{4};
};

/// Regions that contain every expected tag completely, with margins for its uncertainty, its quiet
/// zone and the border that TagDetector skips. Aligned to the library's tiles, so that it processes
/// the same pixels as in the whole image. Joins two regions when one call is cheaper. Skips tags
/// outside of the image.
/// @param out  replaced
void plan_regions(std::span<const ExpectedTag> expected, int width, int height,
                  const RegionRules& rules, std::vector<SearchRegion>& out);

/// Counts of one body's images. Never reset.
struct SearchStatistics {
  std::uint64_t images{};
  std::uint64_t whole_images{};  ///< Searched as a whole, with or without regions.
  std::uint64_t regions{};
  std::uint64_t expected{};  ///< Tags predicted inside of the image.
  std::uint64_t found{};     ///< Of those, found in their region.

  SearchStatistics& operator+=(const SearchStatistics& other) {
    images += other.images;
    whole_images += other.whole_images;
    regions += other.regions;
    expected += other.expected;
    found += other.found;
    return *this;
  }
};

/// Finds the tags in a body's images at the lowest cost that its predictions allow.
///
/// Searches expected tags in regions at full resolution. Searches the whole image at `decimate`
/// every `search_period_s` (cameras take turns), and with it one of four strips at full resolution
/// for small tags; immediately when a steadily found tag is missing, when no expected tag is found,
/// when no tag is expected, or when the regions would cost more than half of the image.
///
/// Keeps, per camera, the times of the last searches and the tags found steadily. One instance per
/// body: its cameras share the threads of the detector. Allocates nothing after warm-up;
/// libapriltag does.
class TagSearch final {
 public:
  /// @pre tags.check().empty() && config.check().empty()
  TagSearch(const TagSetConfig& tags, const DetectorConfig& config);

  /// @param expected  for this image and camera; empty: the whole image is searched
  /// @return one sighting per tag, sorted by id; valid until the next call. An id printed twice
  /// occurs twice when the whole image was searched, once when only the expected one was.
  const CornerFrame& search(const CameraFrame& frame, std::span<const ExpectedTag> expected);

  /// Noise of the last image, of 255; nullopt when it could not be measured.
  [[nodiscard]] std::optional<double> noise() const { return noise_; }
  [[nodiscard]] const SearchStatistics& statistics() const { return statistics_; }

 private:
  struct Steady {
    int tag_id{};
    int images{};  ///< Consecutive images in which it was expected and found.
  };
  struct Camera {
    std::optional<Instant> searched_at;
    std::optional<Instant> strip_at;
    int strip{0};                ///< The next one.
    std::vector<Steady> steady;  ///< One per id that was ever expected, by id.
  };

  /// Searches the camera's next strip at full resolution, for tags too small for `decimate`.
  void search_strip(Camera& camera, const CameraFrame& frame, int contrast);
  /// @return true when the whole image should be searched because of missing tags
  bool note_found(Camera& camera, const GrayImage& image, std::span<const ExpectedTag> expected);
  [[nodiscard]] bool search_is_due(Camera& camera, const CameraFrame& frame) const;
  void drop_repeated();

  DetectorConfig config_;
  TagDetector detector_;
  RegionRules rules_;
  std::vector<Camera> cameras_;
  std::vector<SearchRegion> regions_;
  CornerFrame out_;
  std::optional<double> noise_;
  SearchStatistics statistics_;
};

}  // namespace fiducap
