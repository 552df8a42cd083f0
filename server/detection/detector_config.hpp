#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/config_check.hpp"

namespace fiducap {

struct RecordingInfo;

/// The printed tags of a workspace.
struct TagSetConfig {
  std::string family{"tag36h11"};  ///< `tag36h11`, another of libapriltag, or `DICT_…` of ArUco.
  double size_m{0.16};  ///< Edge between black and white border, unless the id is in `sizes_m`.
  std::map<int, double> sizes_m{};  ///< By tag id, for tags with another size than `size_m`.
  std::vector<int> ignore{};        ///< Ids known to be false or to occur twice.
  /// Sightings with more corrected bits are not used (recordings and on-board detectors).
  int max_hamming{3};

  [[nodiscard]] double edge_of(int tag_id) const {
    const auto found = sizes_m.find(tag_id);
    return found == sizes_m.end() ? size_m : found->second;
  }
  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Of a recording.
[[nodiscard]] TagSetConfig tags_of(const RecordingInfo& recording);

struct DetectorConfig {
  double decimate{2.0};       ///< Of whole images: 1 detects smaller tags at five times the cost.
  double blur_sigma_px{0.0};  ///< Gaussian blur before detection; 0: none.
  bool refine_edges{true};    ///< Moves the sides to the steepest gradient (libapriltag).
  /// Fits the sides between pixels: a third of the corner error, 100 µs per tag.
  bool fit_sides{true};
  int max_hamming{1};                ///< 2 costs 40 MB and yields false ids.
  double min_decision_margin{20.0};  ///< Detections with a smaller margin are not used.
  /// Lowest contrast searched; with `adapt_contrast` its lower bound.
  int min_white_black_diff{5};
  /// Lowest contrast from the measured noise of each image: noisy ones cost 2 to 10 times less.
  bool adapt_contrast{true};
  /// Searches expected tags at full resolution, and the whole image every `search_period_s`.
  bool regions{true};
  /// With `regions`: period of the search of the whole image, and of a quarter of it at full
  /// resolution, for new tags.
  double search_period_s{0.5};
  /// Of one body's detector, shared by its cameras.
  int threads{1};

  [[nodiscard]] std::vector<ConfigError> check() const;
};

}  // namespace fiducap
