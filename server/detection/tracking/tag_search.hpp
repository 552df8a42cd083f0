#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "detection/tracking/search_regions.hpp"

namespace fiducap {

/// What the images of one body cost. Never reset.
struct SearchStatistics {
  std::uint64_t images{};
  std::uint64_t whole_images{};  ///< Searched as a whole, alone or besides regions.
  std::uint64_t regions{};
  std::uint64_t expected{};  ///< Tags that should have been there …
  std::uint64_t found{};     ///< … and were, in their region.

  SearchStatistics& operator+=(const SearchStatistics& other) {
    images += other.images;
    whole_images += other.whole_images;
    regions += other.regions;
    expected += other.expected;
    found += other.found;
    return *this;
  }
};

/// Finds the tags of a body's images with as little work as its expectations allow.
///
/// Expected tags are looked for in regions at full resolution. The whole image is searched at
/// `decimate` every `search_period_s` (cameras take turns), and with it one of four strips at full
/// resolution, for tags that are too small otherwise; at once when a tag that has come steadily is
/// missing, when no expected tag is found, and whenever nothing is expected or the regions would
/// cost more than half of the image.
///
/// Keeps, per camera, when it searched last and which tags came lately. One instance per body: all
/// its cameras share the threads of the detector. Allocates nothing after warm-up; libapriltag
/// does.
class TagSearch final {
 public:
  /// @pre tags.check().empty() && config.check().empty()
  TagSearch(const TagSetConfig& tags, const DetectorConfig& config);

  /// @param expected  for this image and camera; empty: the whole image is searched
  /// @return one sighting per tag, sorted by id; valid until the next call. An id that is printed
  /// twice comes twice when
  ///         the whole image was searched, and once when only the expected one was looked for.
  const CornerFrame& search(const CameraFrame& frame, std::span<const ExpectedTag> expected);

  /// Noise of the last image, of 255; nullopt when it could not be measured.
  [[nodiscard]] std::optional<double> noise() const { return noise_; }
  [[nodiscard]] const SearchStatistics& statistics() const { return statistics_; }

 private:
  struct Steady {
    int tag_id{};
    int images{};  ///< In a row in which it was found when expected.
  };
  struct Camera {
    std::optional<Instant> searched_at;
    std::optional<Instant> strip_at;
    int strip{0};                ///< Which one is next.
    std::vector<Steady> steady;  ///< One per id that was ever expected, by id.
  };

  void search_regions(const GrayImage& image, int contrast);
  void search_whole(const GrayImage& image, int contrast);
  /// A part of the image at full resolution: together they find what is too small for `decimate`.
  void search_strip(Camera& camera, const CameraFrame& frame, int contrast);
  /// @return true when the whole image should be searched because of what was not found.
  bool note_found(Camera& camera, const GrayImage& image, std::span<const ExpectedTag> expected);
  [[nodiscard]] bool search_is_due(Camera& camera, const CameraFrame& frame) const;
  [[nodiscard]] bool regions_pay(const GrayImage& image) const;
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
