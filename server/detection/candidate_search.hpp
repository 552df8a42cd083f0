#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"
#include "detection/detector_config.hpp"

namespace fiducap {

/// What looks like a tag in an image and is not among those that were found.
struct TagCandidate {
  enum class Why {
    kUnsearched,  ///< A good tag; it was not looked for there in this image.
    kLowMargin,   ///< Read, with a decision margin below the configured one.
    kTooSmall,    ///< A dark square with too few pixels for its bits.
    kFaint,       ///< A dark square with hardly any contrast to what surrounds it.
    kUnread,      ///< A dark square whose bits are no tag of the family.
  } why{};
  int tag_id{-1};                               ///< -1: not read.
  int hamming{};                                ///< Corrected bits …
  double decision_margin{};                     ///< … and contrast, of one that was read.
  std::array<Eigen::Vector2d, 4> corners_px{};  ///< Raw pixels, (0, 0) = centre of the first.
};

/// Looks again at an image, for people who wonder why a tag is not found: what the detector would
/// have read with any margin, and dark squares that it cannot read. It decides about nothing.
///
/// Costs as much as a search of the whole image. One instance per thread.
class CandidateSearch final {
 public:
  static constexpr std::size_t kMost = 32;

  /// @pre tags.check().empty() && config.check().empty()
  CandidateSearch(const TagSetConfig& tags, const DetectorConfig& config);
  ~CandidateSearch();

  /// @param found  the tags of this image: they are no candidates, nor is what lies within them
  /// @param out  replaced; at most kMost, the largest first
  void search(const GrayImage& image, std::span<const TagSighting> found,
              std::vector<TagCandidate>& out);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
