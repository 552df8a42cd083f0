#include "daemon/map_start.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <utility>

#include "base/log.hpp"
#include "base/pose.hpp"
#include "daemon/system.hpp"
#include "detection/tag_family.hpp"
#include "mapping/formats/map_format.hpp"
#include "mapping/store/map_repair.hpp"

namespace fiducap {
namespace {

// Beyond, stored and configured extrinsics are of different mountings.
constexpr double kContradiction_sigma = 6.0;
constexpr double kUnitTolerance = 1e-6;

Expected<TagMap> import_map(const std::string& file, double wpilib_edge_m) {
  std::ifstream stream(file);
  std::ostringstream text;
  if (!stream || std::filesystem::is_directory(file))
    return fail(ErrorCode::kNotFound, "map.file cannot be read", file);
  text << stream.rdbuf();
  const auto extension = std::filesystem::path(file).extension();
  if (extension == ".json") return map_from_wpilib_json(text.str(), wpilib_edge_m, file);
  if (extension == ".csv") return map_from_csv(text.str(), file);
  return map_from_yaml(text.str(), file);
}

/// Reads `map.file`; empty without one.
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
  if (map.family != tags.family)
    return fail(ErrorCode::kInvalid,
                "holds " + map.family + " tags, but tags.family is " + tags.family +
                    "; use another map.store",
                settings.store.empty() ? settings.file : settings.store);
  if (const std::string warning = tag_family_warning(tags.family); !warning.empty())
    log::warning("detection", warning);
  if (map.reference_tag && settings.reference_tag && map.reference_tag != settings.reference_tag)
    log::warning("mapping", "the origin of the stored map is tag " +
                                std::to_string(*map.reference_tag) +
                                ", map.reference_tag = " + std::to_string(*settings.reference_tag) +
                                " has an effect only for a new map");
  return {};
}

/// A clock that is configured as exact, or contradicts the configuration, stays as configured.
void use_learned_clock(const StoredClock& learned, CameraMount& mount, double& start_shift_s) {
  const double beyond_s = learned.shift_s - to_seconds(mount.time_shift);
  if (std::abs(beyond_s) < kContradiction_sigma * mount.time_shift_sigma_s)
    start_shift_s = beyond_s;
  if (std::abs(learned.readout_s - mount.readout_s) < kContradiction_sigma * mount.readout_sigma_s)
    mount.readout_s = learned.readout_s;
}

void report_rolled_back(EventBoard& events, std::string text, std::string remedy) {
  events.report({.severity = Severity::kWarning,
                 .subject = "map",
                 .kind = "rolled_back",
                 .text = std::move(text),
                 .remedy = std::move(remedy)});
}

/// Repairs a damaged file once.
Expected<MapStore> open_or_repair(const std::string& path, EventBoard& events) {
  auto store = MapStore::open(path);
  if (store || store.error().code != ErrorCode::kInvalid) return store;
  const auto repaired = repair_map_store(path);
  if (!repaired) {
    if (repaired.error().code != ErrorCode::kInvalid) return tl::unexpected(repaired.error());
    return fail(ErrorCode::kInvalid, "no version in it can be read; it " + store.error().what,
                path);
  }
  if (repaired->found.is_sound() && repaired->kept_as.empty()) return MapStore::open(path);
  const auto lost = repaired->found.sentences();
  std::string text = "the store " + path + " was damaged and has been repaired";
  for (const std::string& one : lost) text += "; " + one;
  report_rolled_back(events, text,
                     repaired->kept_as.empty()
                         ? "check the disk"
                         : "the damaged file is kept as " + repaired->kept_as + "; check the disk");
  return MapStore::open(path);
}

void report_damaged(const SoundVersion& sound, const std::string& path, EventBoard& events) {
  if (sound.damaged.empty()) return;
  std::string text = "went back to version " + std::to_string(sound.map.version) + " of " + path;
  for (const DamagedVersion& one : sound.damaged)
    text += "; version " + std::to_string(one.version) + " " + one.fault;
  report_rolled_back(events, text,
                     "damaged versions stay in the store; `fiducap map repair` makes one without "
                     "them and keeps this one aside");
}

/// The newest valid map of the store, and the cameras estimated with it.
Expected<void> read_store(StartMap& start, const std::string& path, EventBoard& events) {
  auto store = open_or_repair(path, events);
  if (!store) return tl::unexpected(store.error());
  if (auto claimed = store->claim(); !claimed) return claimed;
  auto sound = store->newest_sound();
  if (!sound) return tl::unexpected(sound.error());
  report_damaged(*sound, path, events);
  auto learned = store->extrinsics();
  if (!learned) return tl::unexpected(learned.error());
  start.learned = std::move(*learned);
  start.map = std::move(sound->map);
  start.store.emplace(std::move(*store));
  return {};
}

}  // namespace

Expected<StartMap> open_start_map(const MapSettings& settings, const TagSetConfig& tags,
                                  EventBoard& events) {
  StartMap start;
  if (!settings.store.empty()) {
    if (auto read = read_store(start, settings.store, events); !read)
      return tl::unexpected(read.error());
  }
  const bool is_new = start.map.version == 0;
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
    // Also guards against damaged numbers.
    const bool close = distance_m <= kContradiction_sigma * mount.position_sigma_m &&
                       angle_rad <= kContradiction_sigma * mount.rotation_sigma_rad &&
                       std::abs(stored.X_BV.q.norm() - 1.0) < kUnitTolerance;
    if (!close) {
      log::warning("mapping", body + ": what was learned about camera " +
                                  std::to_string(stored.camera) +
                                  " contradicts the configuration and is not used");
      continue;
    }
    mount.X_BV = stored.X_BV;
  }
}

void doubt_learned_lenses(const std::vector<StoredExtrinsics>& learned,
                          const std::map<std::string, int>& body_ids, TagMap& map) {
  using Kind = FoundMismatch::Kind;
  if (!map.known) return;
  KnownMap known = *map.known;
  for (const StoredExtrinsics& stored : learned) {
    const auto body = body_ids.find(stored.body);
    if (body == body_ids.end()) continue;
    const StoredLens& lens = stored.lens;
    for (const auto& [number, kind] : {std::pair(lens.focal, Kind::kFocalLength),
                                       {lens.centre_u_px, Kind::kCentreU},
                                       {lens.centre_v_px, Kind::kCentreV},
                                       {lens.k1, Kind::kDistortion}})
      if (number) known.wrong_lenses.push_back({body->second, stored.camera, kind});
  }
  map.known = std::make_shared<const KnownMap>(std::move(known));
}

}  // namespace fiducap
