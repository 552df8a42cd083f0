#include "capture/import/imu_pairs.hpp"

#include <algorithm>

namespace fiducap {

std::size_t put_in_order(std::vector<VectorReading>& readings) {
  std::stable_sort(readings.begin(), readings.end(),
                   [](const VectorReading& a, const VectorReading& b) { return a.ns < b.ns; });
  const auto kept =
      std::unique(readings.begin(), readings.end(),
                  [](const VectorReading& a, const VectorReading& b) { return a.ns == b.ns; });
  const auto struck = static_cast<std::size_t>(readings.end() - kept);
  readings.erase(kept, readings.end());
  return struck;
}

ImuPairs pair_readings(const std::vector<VectorReading>& gyro,
                       const std::vector<VectorReading>& accel, Duration longest_gap) {
  ImuPairs pairs;
  pairs.samples.reserve(gyro.size());
  auto after = accel.begin();
  for (const VectorReading& g : gyro) {
    while (after != accel.end() && after->ns < g.ns) ++after;
    if (after != accel.end() && after->ns == g.ns) {
      pairs.samples.push_back({instant_from_ns(g.ns), g.v, after->v});
      continue;
    }
    const bool between = after != accel.begin() && after != accel.end();
    if (!between || after->ns - (after - 1)->ns > longest_gap.count()) {
      ++pairs.alone;
      continue;
    }
    const VectorReading& before = *(after - 1);
    const double share =
        static_cast<double>(g.ns - before.ns) / static_cast<double>(after->ns - before.ns);
    pairs.samples.push_back({instant_from_ns(g.ns), g.v, before.v + share * (after->v - before.v)});
  }
  return pairs;
}

}  // namespace fiducap
