#pragma once

#include <gmock/gmock.h>

#include "mapping/map_builder.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {

inline constexpr std::int64_t kNow_utc_ns = 1'700'000'100'000'000'000;

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

/// A solution with one tag.
inline GraphSolution solution_with(const GraphTagEstimate& tag) {
  GraphSolution solution;
  solution.tags.push_back(tag);
  return solution;
}

}  // namespace fiducap
