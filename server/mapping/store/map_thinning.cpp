#include "mapping/store/map_thinning.hpp"

#include <algorithm>
#include <array>
#include <chrono>

namespace fiducap {

namespace {

struct Spacing {
  std::chrono::seconds younger_than;
  std::chrono::seconds one_per;
};

using std::chrono::hours;
using std::chrono::minutes;
constexpr std::array<Spacing, 6> kSpacings{{{minutes(10), {}},
                                            {hours(1), minutes(1)},
                                            {hours(24), minutes(10)},
                                            {hours(24 * 7), hours(1)},
                                            {hours(24 * 365), hours(24)},
                                            {std::chrono::seconds::max(), hours(24 * 30)}}};
constexpr std::int64_t kSecond_ns = 1'000'000'000;

/// Whole seconds: differences of damaged times must not overflow.
std::int64_t seconds_of(const VersionAge& one) { return one.created_utc_ns / kSecond_ns; }

std::int64_t spacing_at(std::int64_t age_s) {
  return std::find_if(kSpacings.begin(), kSpacings.end() - 1,
                      [&](const Spacing& one) { return age_s < one.younger_than.count(); })
      ->one_per.count();
}

}  // namespace

std::vector<std::int64_t> versions_to_thin(std::span<const VersionAge> newest_first) {
  std::vector<std::int64_t> old;
  std::int64_t last_spacing_s = 0;
  std::int64_t last_span = 0;
  for (const VersionAge& one : newest_first) {
    if (!one.automatic || &one == &newest_first.front()) continue;
    const std::int64_t spacing_s = spacing_at(seconds_of(newest_first.front()) - seconds_of(one));
    if (spacing_s == 0) continue;
    const std::int64_t span = seconds_of(one) / spacing_s;
    if (spacing_s == last_spacing_s && span == last_span) old.push_back(one.version);
    last_spacing_s = spacing_s;
    last_span = span;
  }
  return old;
}

}  // namespace fiducap
