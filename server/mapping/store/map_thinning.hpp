#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace fiducap {

/// What thinning asks of a version.
struct VersionAge {
  std::int64_t version{};
  std::int64_t created_utc_ns{};
  bool automatic{};  ///< Nobody asked for it; others are never thinned out.
};

/// Which automatic versions may go: of the last ten minutes none; of the hour before all but one a
/// minute; of the day one per ten minutes, of the week one an hour, of the year one a day, then one
/// per 30 days. The last of each such span stays. Ages count from the newest version, which stays,
/// so that a server that was off for a year finds what it left.
/// @param newest_first  all versions of the store
[[nodiscard]] std::vector<std::int64_t> versions_to_thin(std::span<const VersionAge> newest_first);

}  // namespace fiducap
