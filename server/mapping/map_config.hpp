#pragma once

#include <cstddef>
#include <vector>

#include "base/config_check.hpp"

namespace fiducap {

enum class MapMode {
  kMapping,  ///< The map grows and is refined live.
  kFrozen,   ///< The map never changes: no control loop sees a jump.
};

inline constexpr double kRefinePeriod_s = 2;

/// For so many bodies that share a map. One alone finds out better what is wrong with its lens and
/// its prints without (docs/design/map-graph.md).
[[nodiscard]] constexpr double refine_period_for(std::size_t bodies) {
  return bodies > 1 ? kRefinePeriod_s : 0;
}

struct MapConfig {
  MapMode mode{MapMode::kMapping};
  /// A belief joins the map when its tag is known better than this …
  double publish_position_sigma_m{0.05};
  double publish_rotation_sigma_rad{0.05};  ///< … and this (worst axis).
  int publish_sightings{10};                ///< … and was seen at least this often.
  /// What all bodies saw is solved together this often, in seconds of their data, and the map is
  /// what comes out (MapRefiner): every tag seen often enough, with its sigma, whatever that is.
  /// 0: never, each tag is the business of the body that knows it best. Who does not say means
  /// refine_period_for().
  double refine_period_s{0.0};
  double commit_period_s{10.0};  ///< A changed map is written to the store this often.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

}  // namespace fiducap
