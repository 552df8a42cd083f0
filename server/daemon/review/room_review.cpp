// Tags and map: whether anything can be tracked in them, and what is up.
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "daemon/bodies/body_setup.hpp"
#include "daemon/review/config_review.hpp"
#include "detection/tag_family.hpp"
#include "mapping/store/map_store.hpp"

namespace fiducap {

namespace {

namespace fs = std::filesystem;

/// Ids that the family does not have can never be seen.
void review_ids(const ServerConfig& config, ConfigReview& review) {
  const auto family = TagFamily::named(config.tags.family);
  if (!family) return;
  const auto check = [&](const std::string& path, int id) {
    if (id >= 0 && id < family->ids()) return;
    review.fault(path, std::to_string(id),
                 "is no tag of " + config.tags.family + ", which has 0 to " +
                     std::to_string(family->ids() - 1));
  };
  for (const auto& [id, size] : config.tags.sizes_m) check("tags.sizes_m", id);
  for (const int id : config.tags.ignore) check("tags.ignore", id);
  for (const int id : config.map.floor_tags) check("map.floor_tags", id);
  if (!config.map.reference_tag) return;
  const int reference = *config.map.reference_tag;
  check("map.reference_tag", reference);
  const auto& ignored = config.tags.ignore;
  if (std::find(ignored.begin(), ignored.end(), reference) != ignored.end())
    review.fault("map.reference_tag", std::to_string(reference),
                 "stands in tags.ignore: it would never be seen");
}

std::optional<std::size_t> stored_tags(const std::string& store, ConfigReview& review) {
  std::error_code ignored;
  if (store.empty() || !fs::exists(store, ignored)) return std::nullopt;
  const auto opened = MapStore::open_to_read(store);
  const auto map = opened ? opened->newest() : tl::unexpected(opened.error());
  if (map) return map->tags.size();
  review.fault("map.store", store, map.error().what);
  return std::nullopt;
}

void review_folder_of(const std::string& store, ConfigReview& review) {
  std::error_code ignored;
  const fs::path folder = fs::absolute(store, ignored).parent_path();
  if (!fs::is_directory(folder, ignored)) {
    // What is below /var/lib is the service's own: it has not been started yet.
    if (folder.string().starts_with("/var/lib/"))
      return review.doubt("map.store", store,
                          "its folder does not exist yet: systemd makes it when it starts the "
                          "service. Who starts fiducapd by hand makes it first");
    return review.fault("map.store", store, "its folder does not exist: make it first");
  }
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    review.fault("map.store", store, "this user may not write to its folder");
}

void review_map_files(const ServerConfig& config, ConfigReview& review) {
  const MapSettings& map = config.map;
  std::error_code ignored;
  const bool has_file = !map.file.empty() && fs::exists(map.file, ignored);
  if (!map.file.empty() && !has_file) review.fault("map.file", map.file, "there is no such file");
  if (!map.store.empty()) review_folder_of(map.store, review);
  const auto stored = stored_tags(map.store, review);
  const bool has_map = has_file || stored.value_or(0) > 0;
  if (map.builder.mode == MapMode::kFrozen && !has_map)
    review.fault("map.mode", "frozen",
                 "has no map to be frozen: nothing will ever be tracked. Begin with `mapping`, or "
                 "name a map in map.file or map.store");
  if (map.builder.mode == MapMode::kMapping && map.store.empty())
    review.doubt("map.store", "\"\"",
                 "is not set: the map is forgotten when the server ends, and another one begins");
  std::string line = map.builder.mode == MapMode::kFrozen ? "a frozen map" : "a growing map";
  if (stored) line += ", " + std::to_string(*stored) + " tags stored in " + map.store;
  if (has_file && stored.value_or(0) == 0) line += ", beginning with " + map.file;
  review.plan.push_back(line + "; tags " + config.tags.family + ", " +
                        std::to_string(static_cast<int>(1e3 * config.tags.size_m + 0.5)) + " mm");
}

bool has_imu(const ServerConfig& config) {
  return std::any_of(config.bodies.begin(), config.bodies.end(), [&](const BodyConfig& body) {
    const auto setup = read_body_setup(body, config.simulation, config.site);
    return setup && setup->sensors.imu;
  });
}

void review_gauge(const ServerConfig& config, ConfigReview& review) {
  const MapSettings& map = config.map;
  const bool begins = map.file.empty() && map.builder.mode == MapMode::kMapping;
  if (!begins) return;
  if (!map.reference_tag)
    review.doubt(
        "map.reference_tag", "null",
        "is not set: the first tag that is seen becomes the origin, another one next time");
  if (!has_imu(config) && !map.reference_pose && map.floor_tags.empty())
    review.doubt(
        "map.floor_tags", "[]",
        "nothing says what is up: no body has an IMU. Name three tags that lie flat on the "
        "floor, or give map.reference_pose");
}

}  // namespace

void review_room(const ServerConfig& config, ConfigReview& review) {
  review_ids(config, review);
  review_map_files(config, review);
  review_gauge(config, review);
}

}  // namespace fiducap
