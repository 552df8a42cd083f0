#pragma once

#include <memory>
#include <span>
#include <vector>

#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"
#include "detection/detector_config.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// A probable tag in an image that was not found.
struct TagCandidate {
  enum class Why {
    kUnsearched,  ///< A good tag in a part of the image that was not searched.
    kLowMargin,   ///< Read, with a decision margin below the configured one.
    kTooSmall,    ///< A dark square with too few pixels for its bits.
    kFaint,       ///< A dark square with low contrast to its surroundings.
    kUnread,      ///< A dark square with the bits of no tag of the family.
  } why{};
  int tag_id{-1};            ///< -1: not read.
  int hamming{};             ///< Corrected bits, if read.
  double decision_margin{};  ///< Contrast of the bits, if read.
  TagCorners corners_px{};   ///< Raw pixels, (0, 0) = centre of the first.
};

/// Searches an image for tags that were not found, to show the user why: tags of any margin, and
/// dark squares that cannot be read.
///
/// Costs as much as a search of the whole image. One instance per thread.
class CandidateSearch final {
 public:
  static constexpr std::size_t kMost = 32;

  /// @pre tags.check().empty() && config.check().empty()
  CandidateSearch(const TagSetConfig& tags, const DetectorConfig& config);
  ~CandidateSearch();

  /// @param found  the tags of this image; excluded with everything inside of them
  /// @param out  replaced; at most kMost, the largest first
  void search(const GrayImage& image, std::span<const TagSighting> found,
              std::vector<TagCandidate>& out);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
