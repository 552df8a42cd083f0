#pragma once

#include <gmock/gmock.h>

#include "mapping/map_builder.hpp"
#include "unit/mapping/map_fixture.hpp"

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

/// An event of that kind whose text contains `text`.
inline testing::Matcher<MapEvent> event_of(MapEvent::Kind kind, const std::string& text = "") {
  return testing::AllOf(testing::Field(&MapEvent::kind, kind),
                        testing::Field(&MapEvent::text, testing::HasSubstr(text)));
}

/// An estimate of the map graph at (x, 0, 0).
inline GraphTagEstimate graph_estimate(int tag_id, double x, int epoch = 0, double sigma = 0.001) {
  GraphTagEstimate tag;
  tag.tag_id = tag_id;
  tag.edge_m = 0.2;
  tag.sightings = 200;
  tag.first_seen = instant_from_ns(1'000'000'000);
  tag.last_seen = instant_from_ns(10'000'000'000);
  tag.X_WT.p.x() = x;
  tag.covariance = Matrix6d::Identity() * sigma * sigma;
  tag.epoch = epoch;
  return tag;
}

}  // namespace fiducap
