// Maps as text of ours and of other programs, and stores. Accepted ones are sound, are written, and
// are read again as the same map.
#include <array>
#include <cmath>

#include "fuzz/memory_file.hpp"
#include "mapping/formats/map_format.hpp"
#include "mapping/store/map_store.hpp"
#include "support/temporary_folder.hpp"

namespace {

void require_round_trip(MapFormat format, const std::string& text) {
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

void require_same(const TagMap& map, const Expected<TagMap>& again) {
  require(again.has_value() && content_hash(*again) == content_hash(map));
}

}  // namespace

FUZZ(map_tagslam_fuzz, input) { require_round_trip(MapFormat::kTagslam, input.text()); }
FUZZ(map_bundles_fuzz, input) { require_round_trip(MapFormat::kBundles, input.text()); }
FUZZ(map_rcars_fuzz, input) { require_round_trip(MapFormat::kRcars, input.text()); }
FUZZ(map_aruco_fuzz, input) { require_round_trip(MapFormat::kAruco, input.text()); }
FUZZ(map_limelight_fuzz, input) { require_round_trip(MapFormat::kLimelight, input.text()); }

FUZZ(map_yaml_fuzz, input) {
  if (const auto map = map_from_yaml(input.text(), "fuzz"))
    require_same(*map, map_from_yaml(map_to_yaml(*map), "again"));
}

FUZZ(map_csv_fuzz, input) {
  if (const auto map = map_from_csv(input.text(), "fuzz"))
    require_same(*map, map_from_csv(map_to_csv(*map), "again"));
}

// The first byte chooses the size of the tags, which is not in a field layout of WPILib.
FUZZ(map_wpilib_fuzz, input) {
  constexpr std::array<double, 4> kEdges_m{0.1651, 0, -1, 1e308};
  const double edge_m = kEdges_m[input.choose(4)];
  const auto map = map_from_wpilib_json(input.text(), edge_m, "fuzz");
  if (!map) return;
  require(!fault_in(*map) && map_from_yaml(map_to_yaml(*map), "again").has_value());
  const auto written = map_to_wpilib_json(*map, std::nullopt).text;
  require(map_from_wpilib_json(written, edge_m, "again").has_value());
}

// A damaged store. Opening it may fail, but not crash or hang; loaded maps are sound.
FUZZ(map_store_fuzz, input) {
  static const TemporaryFolder folder;
  static const std::string path = folder.file("map.sqlite");
  for (const char* end : {"-wal", "-shm", "-journal"}) ::unlink((path + end).c_str());
  folder.write("map.sqlite", input.text());
  auto store = MapStore::open(path);
  if (!store) return;
  if (const auto newest = store->newest()) require(!fault_in(*newest));
  const auto log = store->log();
  if (log && !log->empty()) (void)store->load(log->back().version);
  (void)store->extrinsics();
}
