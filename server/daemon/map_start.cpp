#include "daemon/map_start.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "base/log.hpp"
#include "base/so3.hpp"
#include "daemon/system_clock.hpp"
#include "mapping/formats/map_yaml.hpp"

namespace fiducap {

namespace {

// Beyond this the stored extrinsics and the configured ones are not about the same mounting.
constexpr double kContradiction_sigma = 6.0;

Expected<TagMap> import_map(const std::string& file, double wpilib_edge_m) {
  std::ifstream stream(file);
  std::ostringstream text;
  if (!stream || std::filesystem::is_directory(file)) {
    return fail(ErrorCode::kNotFound, "map.file cannot be read", file);
  }
  text << stream.rdbuf();
  const auto extension = std::filesystem::path(file).extension();
  if (extension == ".json") return map_from_wpilib_json(text.str(), wpilib_edge_m, file);
  if (extension == ".csv") return map_from_csv(text.str(), file);
  return map_from_yaml(text.str(), file);
}

/// Reads `map.file`; without one the room is unknown.
Expected<TagMap> first_map(const MapSettings& settings, const TagSetConfig& tags) {
  TagMap map;
  if (!settings.file.empty()) {
    auto imported = import_map(settings.file, settings.file_tag_size_m);
    if (!imported) return imported;
    map = std::move(*imported);
    map.created_utc_ns = utc_now_ns();
    map.comment = "imported from " + settings.file;
    log::info("mapping", std::to_string(map.tags.size()) + " tags " + map.comment);
  } else {
    map.family = tags.family;
  }
  if (settings.reference_tag) map.reference_tag = settings.reference_tag;
  return map;
}

Expected<void> check_against(const TagMap& map, const MapSettings& settings,
                             const TagSetConfig& tags) {
  if (map.family != tags.family) {
    return fail(ErrorCode::kInvalid,
                "holds " + map.family + " tags, but tags.family is " + tags.family +
                    "; use another map.store",
                settings.store.empty() ? settings.file : settings.store);
  }
  if (map.reference_tag && settings.reference_tag && map.reference_tag != settings.reference_tag) {
    log::warning("mapping", "the stored map hangs on tag " + std::to_string(*map.reference_tag) +
                                ", map.reference_tag = " + std::to_string(*settings.reference_tag) +
                                " only counts for a new map");
  }
  return {};
}

/// A clock that the configuration calls exact, or that contradicts it, stays as configured.
void use_learned_clock(const StoredClock& learned, CameraMount& mount, double& start_shift_s) {
  if (std::abs(learned.shift_s) < kContradiction_sigma * mount.time_shift_sigma_s)
    start_shift_s = learned.shift_s;
  if (std::abs(learned.readout_s - mount.readout_s) < kContradiction_sigma * mount.readout_sigma_s)
    mount.readout_s = learned.readout_s;
}

}  // namespace

Expected<StartMap> open_start_map(const MapSettings& settings, const TagSetConfig& tags) {
  StartMap start;
  bool is_new = true;
  if (!settings.store.empty()) {
    auto store = MapStore::open(settings.store);
    if (!store) return tl::unexpected(store.error());
    if (auto claimed = store->claim(); !claimed) return tl::unexpected(claimed.error());
    start.store.emplace(std::move(*store));
    auto newest = start.store->newest();
    if (!newest) return tl::unexpected(newest.error());
    auto learned = start.store->extrinsics();
    if (!learned) return tl::unexpected(learned.error());
    start.learned = std::move(*learned);
    is_new = newest->version == 0;
    start.map = std::move(*newest);
  }
  if (is_new) {
    auto first = first_map(settings, tags);
    if (!first) return tl::unexpected(first.error());
    start.map = std::move(*first);
  }
  if (const auto fits = check_against(start.map, settings, tags); !fits)
    return tl::unexpected(fits.error());
  if (is_new && start.store && !start.map.tags.empty()) {
    auto committed = start.store->commit(start.map, start.map.comment);
    if (!committed) return tl::unexpected(committed.error());
    start.map = std::move(*committed);
  }
  return start;
}

void use_learned(const std::vector<StoredExtrinsics>& learned, const std::string& body,
                 BodySensors& sensors) {
  std::vector<CameraMount>& cameras = sensors.cameras;
  sensors.start_shifts_s.assign(cameras.size(), 0.0);
  for (const auto& stored : learned) {
    if (stored.body != body || stored.camera < 0 ||
        static_cast<std::size_t>(stored.camera) >= cameras.size())
      continue;
    const auto k = static_cast<std::size_t>(stored.camera);
    CameraMount& mount = cameras[k];
    if (stored.clock) use_learned_clock(*stored.clock, mount, sensors.start_shifts_s[k]);
    const double distance_m = (stored.X_BV.p - mount.X_BV.p).norm();
    const double angle_rad = angle_between(stored.X_BV.q, mount.X_BV.q);
    if (distance_m > kContradiction_sigma * mount.position_sigma_m ||
        angle_rad > kContradiction_sigma * mount.rotation_sigma_rad) {
      log::warning("mapping", body + ": what was learned about camera " +
                                  std::to_string(stored.camera) +
                                  " contradicts the configuration; the configuration holds");
      continue;
    }
    mount.X_BV = stored.X_BV;
  }
}

}  // namespace fiducap
