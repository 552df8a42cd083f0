#pragma once

#include "mapping/map_builder.hpp"

namespace fiducap {

inline constexpr std::int64_t kNow_utc_ns = 1'700'000'100'000'000'000;

inline const MapConfig kByBeliefs{.refine_period_s = 0};

inline TagBelief belief(int id, double sigma = 0.01, double x = 1.0, int sightings = 20) {
  TagBelief b;
  b.tag.tag_id = id;
  b.tag.edge_m = 0.2;
  b.tag.X_WT.p = {x, 2, 3};
  b.tag.covariance = Matrix6d::Identity() * sigma * sigma;
  b.sightings = sightings;
  b.first_seen = instant_from_ns(1'000'000'000);
  b.last_seen = instant_from_ns(4'000'000'000);
  return b;
}

inline MapContribution from(int body, const TagBelief& b) {
  return {.body_id = body, .at = b.last_seen, .anchored = true, .beliefs = std::span(&b, 1)};
}

}  // namespace fiducap
