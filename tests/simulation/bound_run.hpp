#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "simulation/estimation_data.hpp"
#include "support/bound/causal_bound.hpp"

namespace fiducap {

/// Prior knowledge: `A` map unknown, extrinsics with prior; `B` map unknown, true
/// extrinsics; `C` true map, extrinsics with prior; `D` both true.
struct KnowledgeCase {
  char letter{'A'};
  [[nodiscard]] bool map_known() const { return letter == 'C' || letter == 'D'; }
  [[nodiscard]] bool extrinsics_known() const { return letter == 'B' || letter == 'D'; }
};

/// The causal bound along one set of data, after each image.
struct BoundRun {
  std::vector<bound::BoundAt> at;
  bound::MapBound map;                ///< At the end.
  bound::TagsCovariance tags;         ///< At the end; with an unknown map.
  std::optional<bound::BoundAt> gap;  ///< Before the reference tag is seen again after kAway_s.
};

/// Time out of sight after which its return closes a loop.
inline constexpr double kAway_s = 30.0;

/// @pre data has an IMU and its ids are right
[[nodiscard]] BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge);

/// Noise of the corners of one sighting.
using SightNoise = std::function<bound::TagSight(const CornerFrame&, const TagSighting&)>;
/// The same with a noise for every sighting.
[[nodiscard]] BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge,
                                 const SightNoise& noise,
                                 const std::optional<bound::LastingErrors>& lasting);

}  // namespace fiducap
