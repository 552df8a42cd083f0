#pragma once

#include <algorithm>
#include <string>

#include "fuzz/memory_file.hpp"
#include "mapping/formats/map_format.hpp"

namespace fiducap::fuzz {

/// The map of another program: what is read is a sound map, is written, and is read again with
/// every tag where it was.
inline void require_round_trip(MapFormat format, const std::string& text) {
  const MapImportOptions options{.edge_m = 0.16};
  const auto read = read_map(format, text, options, "fuzz");
  if (!read) return;
  require(!read->map.tags.empty() && !fault_in(read->map));
  const auto again = read_map(format, write_map(format, read->map).text, options, "again");
  require(again.has_value() && again->map.tags.size() == read->map.tags.size());
  for (std::size_t i = 0; i < read->map.tags.size(); ++i) {
    const KnownTag& a = read->map.tags[i].tag;
    const KnownTag& b = again->map.tags[i].tag;
    const Eigen::Vector3d corner(0.5 * a.edge_m, 0.5 * a.edge_m, 0);
    // Places of 1000 km have a last digit of a tenth of a nanometre.
    constexpr double kRoundTrip_m = 1e-6;
    require(a.tag_id == b.tag_id && std::abs(a.edge_m - b.edge_m) < kRoundTrip_m);
    require((a.X_WT * corner - b.X_WT * corner).norm() < kRoundTrip_m);
  }
}

}  // namespace fiducap::fuzz
