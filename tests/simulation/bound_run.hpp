#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "simulation/estimation_data.hpp"
#include "support/bound/causal_bound.hpp"

namespace fiducap {

/// What is given beforehand: `A` map unknown, extrinsics with prior; `B` map unknown, true
/// extrinsics; `C` true map, extrinsics with prior; `D` both true.
struct KnowledgeCase {
  char letter{'A'};
  [[nodiscard]] bool map_known() const { return letter == 'C' || letter == 'D'; }
  [[nodiscard]] bool extrinsics_known() const { return letter == 'B' || letter == 'D'; }
};

/// The causal bound along one set of data, after each image.
struct BoundRun {
  std::vector<bound::BoundAt> at;
  bound::MapBound map;  ///< At the end.
  std::optional<bound::BoundAt>
      gap;  ///< Just before the reference tag is seen again after kAway_s.
};

/// So long out of sight that its return closes a loop.
inline constexpr double kAway_s = 30.0;

/// Tags of the data that an image shows (other ids are left out).
[[nodiscard]] std::vector<int> ids_in(const CornerFrame& image, const EstimationData& data);

/// @pre data has an IMU and its ids are right
[[nodiscard]] BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge);

/// How the corners of one sighting are off.
using SightNoise = std::function<bound::TagSight(const CornerFrame&, const TagSighting&)>;
/// The same with corners of which each tag's are differently good.
[[nodiscard]] BoundRun run_bound(const EstimationData& data, KnowledgeCase knowledge,
                                 const SightNoise& noise,
                                 const std::optional<bound::LastingErrors>& lasting);

}  // namespace fiducap
