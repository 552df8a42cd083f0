#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "capture/gray_image.hpp"
#include "detection/detector_config.hpp"

namespace fiducap {

using SharedImage = std::shared_ptr<const GrayImage>;

/// Keeps a few of many images, evenly spread over all of them, without copies.
class FewImages final {
 public:
  void note(const SharedImage& image) {
    if (seen_++ % stride_ != 0) return;
    if (kept_.size() == kMost) {
      for (std::size_t i = 0; 2 * i < kMost; ++i) kept_[i] = std::move(kept_[2 * i]);
      kept_.resize(kMost / 2);
      stride_ *= 2;
    }
    kept_.push_back(image);
  }
  void clear() {
    kept_.clear();
    seen_ = 0;
    stride_ = 1;
  }
  [[nodiscard]] const std::vector<SharedImage>& images() const { return kept_; }

 private:
  static constexpr std::size_t kMost = 6;

  std::vector<SharedImage> kept_;
  std::size_t seen_{0};
  std::size_t stride_{1};
};

/// Why no tag was found in these images, as a sentence with a figure and what to do. Looks at up to
/// three of them again: with every pixel, for all families and Kalibr's AprilGrid, mirrored, as a
/// negative, enlarged; then at light, blur and dark squares.
///
/// Costs up to some 20 searches of an image, about a second: not for each image.
/// @pre tags.check().empty() && config.check().empty()
/// @return empty without images, or when stopped
[[nodiscard]] std::string why_no_tag(std::span<const SharedImage> images, const TagSetConfig& tags,
                                     const DetectorConfig& config, std::stop_token stop = {});

/// For a person before a live camera: why no tag is found, once a number of images in a row shows
/// none. The image that completes the number costs as much as why_no_tag.
class NoTagAdvice final {
 public:
  static constexpr int kImages = 60;

  /// @pre tags.check().empty()
  explicit NoTagAdvice(TagSetConfig tags) : tags_(std::move(tags)) {}

  void note(const SharedImage& image, bool has_tags) {
    if (has_tags) {
      few_.clear();
      images_ = 0;
      why_.clear();
      return;
    }
    few_.note(image);
    if (++images_ == kImages) why_ = why_no_tag(few_.images(), tags_, {});
  }
  /// Empty: tags are seen, or not enough images are without.
  [[nodiscard]] const std::string& why() const { return why_; }

 private:
  TagSetConfig tags_;
  FewImages few_;  ///< Since the last one with a tag.
  int images_{0};  ///< In a row without.
  std::string why_;
};

/// Whether tags of another family than the configured one are in these images, as a sentence; empty
/// if not, or if more are of the configured one. For sightings that contradict each other: weak
/// families read false tags in other ones.
[[nodiscard]] std::string other_family_in(std::span<const SharedImage> images,
                                          const TagSetConfig& tags);

}  // namespace fiducap
