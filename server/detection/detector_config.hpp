#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/config_check.hpp"

namespace fiducap {

struct RecordingInfo;

/// What is printed in the room.
struct TagSetConfig {
  std::string family{"tag36h11"};
  double size_m{0.16};  ///< Edge between black and white border, unless the id is in `sizes_m`.
  std::map<int, double> sizes_m{};
  std::vector<int> ignore{};  ///< Ids known to be false or doubled.
  int max_hamming{
      3};  ///< Sightings with more corrected bits are not used (recordings and on-board detectors).

  [[nodiscard]] double edge_of(int tag_id) const {
    const auto found = sizes_m.find(tag_id);
    return found == sizes_m.end() ? size_m : found->second;
  }
  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// As a recording says it.
[[nodiscard]] TagSetConfig tags_of(const RecordingInfo& recording);

struct DetectorConfig {
  double decimate{2.0};  ///< Of whole images: 1 sees smaller tags at five times the cost.
  double blur_sigma_px{0.0};
  bool refine_edges{true};
  /// Sides fitted again between pixels: corners a third as far off, 100 µs per tag.
  bool fit_sides{true};
  int max_hamming{1};  ///< 2 costs 40 MB and finds false ids.
  double min_decision_margin{20.0};
  /// Least contrast worth a look; with `adapt_contrast` the lower bound.
  int min_white_black_diff{5};
  /// Least contrast from the measured noise of each image: noisy ones cost 2 to 10 times less.
  bool adapt_contrast{true};
  /// Look where tags are expected at full resolution, and at the whole image now and then.
  bool regions{true};
  /// With `regions`: the whole image is searched for new tags this often, and a quarter of it at
  /// full resolution.
  double search_period_s{0.5};
  /// Of one body's detector: all its cameras share them.
  int threads{1};

  [[nodiscard]] std::vector<ConfigError> check() const;
};

}  // namespace fiducap
