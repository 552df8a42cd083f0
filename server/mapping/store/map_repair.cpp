#include "mapping/store/map_repair.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>
#include <utility>

#include "mapping/store/file_claim.hpp"
#include "mapping/store/sqlite_file.hpp"

namespace fiducap {

namespace {

namespace fs = std::filesystem;

// Between two readable ends of a damaged list, numbers are tried one by one.
constexpr std::int64_t kMostTried = 100'000;

std::string number(std::int64_t value) { return std::to_string(value); }

/// Collects the numbers of a query, until a page cannot be read. @return whether all were read
bool collect(const SqliteFile& file, const char* sql, std::set<std::int64_t>& numbers) {
  auto rows = file.prepare(sql);
  return rows.each_row([&] { numbers.insert(rows.integer(0)); }).has_value();
}

/// A damaged page ends the iteration over a table, so it is read from both ends, and the numbers
/// between are tried.
std::set<std::int64_t> version_numbers(const SqliteFile& file, std::vector<std::string>& losses) {
  std::set<std::int64_t> numbers;
  if (!collect(file, "SELECT DISTINCT version FROM tag ORDER BY version", numbers))
    collect(file, "SELECT DISTINCT version FROM tag ORDER BY version DESC", numbers);
  std::set<std::int64_t> below;
  std::set<std::int64_t> above;
  if (!collect(file, "SELECT version FROM version ORDER BY version", below)) {
    collect(file, "SELECT version FROM version ORDER BY version DESC", above);
    const std::int64_t first = below.empty() ? 1 : *below.rbegin() + 1;
    const std::int64_t last = !above.empty()     ? *above.begin() - 1
                              : !numbers.empty() ? *numbers.rbegin()
                                                 : first - 1;
    losses.push_back("the list of versions has a hole" +
                     (first <= last ? " from " + number(first) + " to " + number(last)
                                    : " behind " + number(first - 1)));
    for (std::int64_t one = first; one <= last && one - first < kMostTried; ++one)
      if (load_map(file, one)) numbers.insert(one);
  }
  numbers.merge(below);
  numbers.merge(above);
  return numbers;
}

MapStoreHealth health_of(const SqliteFile& file) {
  MapStoreHealth health;
  const auto broken = file.structural_fault();
  health.structure = broken ? *broken : broken.error().what;
  for (const std::int64_t version : version_numbers(file, health.losses)) {
    const auto map = load_map(file, version);
    if (map)
      health.sound.push_back(version);
    else if (map.error().code == ErrorCode::kNotFound)
      health.damaged.push_back({version, "its description is gone"});
    else
      health.damaged.push_back({version, map.error().what});
  }
  if (const auto learned = load_extrinsics(file); !learned)
    health.losses.push_back("the estimates about the cameras cannot be read");
  return health;
}

/// Skips damaged versions, as far as their parents can be read.
std::int64_t sound_ancestor(const SqliteFile& file, const std::vector<std::int64_t>& sound,
                            const TagMap& map) {
  std::int64_t ancestor = map.parent;
  while (ancestor > 0 && !std::binary_search(sound.begin(), sound.end(), ancestor)) {
    const auto next =
        file.integer("SELECT parent FROM version WHERE version = " + number(ancestor));
    if (!next || *next >= ancestor) return 0;
    ancestor = *next;
  }
  return std::max<std::int64_t>(ancestor, 0);
}

Expected<void> copy_content(const SqliteFile& from, const std::vector<std::int64_t>& sound,
                            SqliteFile& to) {
  if (auto set = to.execute("PRAGMA auto_vacuum = INCREMENTAL; PRAGMA synchronous = EXTRA"); !set)
    return set;
  return to.transaction([&]() -> Expected<void> {
    if (auto created = create_tables(to); !created) return created;
    for (const std::int64_t version : sound) {
      auto map = load_map(from, version);
      if (!map) return tl::unexpected(map.error());
      map->parent = sound_ancestor(from, sound, *map);
      if (auto written = insert_map(to, *map); !written) return written;
    }
    if (const auto learned = load_extrinsics(from)) {
      for (const StoredExtrinsics& one : *learned)
        if (auto written = save_extrinsics(to, one); !written) return written;
    }
    return {};
  });
}

Expected<SqliteFile> open_damaged(const std::string& path) {
  auto file = SqliteFile::open(path, SqliteFile::Access::kSalvage);
  if (!file) return file;
  const auto application = file->integer("PRAGMA application_id");
  if (!application) return tl::unexpected(application.error());
  const auto schema = file->integer("PRAGMA user_version");
  if (!schema) return tl::unexpected(schema.error());
  if (*application != kMapStoreId || *schema > kMapStoreSchema)
    return fail(ErrorCode::kUnsupported,
                "is no map store that this program knows; it was not changed", path);
  if (const auto definition = file->definition(); definition && !definition->empty())
    return fail(ErrorCode::kInvalid,
                "has a " + *definition + ", which no map store has; it was not run", path);
  return file;
}

// --- the place of the damaged file ---

tl::unexpected<Error> system_fault(const std::string& doing, const std::string& path) {
  return fail(ErrorCode::kUnavailable, "cannot " + doing + ": " + std::strerror(errno), path);
}

/// Makes renaming in a folder permanent.
Expected<void> sync_folder_of(const std::string& path) {
  const fs::path parent = fs::path(path).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return system_fault("open the folder", folder);
  const int done = ::fsync(file);
  ::close(file);
  if (done != 0) return system_fault("sync the folder", folder);
  return {};
}

/// The user of the server must be able to use the repaired store.
Expected<void> same_owner(const std::string& model, const std::string& path) {
  struct stat was {};
  if (::stat(model.c_str(), &was) != 0) return {};
  struct stat is {};
  if (::stat(path.c_str(), &is) != 0) return system_fault("look at the repaired store", path);
  // Only when needed: a service may not change owners (deploy/fiducapd.service).
  const bool is_same = is.st_uid == was.st_uid && is.st_gid == was.st_gid;
  if (!is_same && ::chown(path.c_str(), was.st_uid, was.st_gid) != 0)
    return system_fault(
        "give the repaired store to the owner of the damaged one; run this as that user", path);
  if (::chmod(path.c_str(), was.st_mode & 07777) != 0)
    return system_fault("set the mode of the repaired store", path);
  return {};
}

/// Gives the damaged file and its log a second name, if an earlier attempt has not done so.
Expected<std::string> keep_aside(const std::string& path) {
  std::error_code ignored;
  int n = 1;
  std::string kept = path + ".damaged-1";
  while (fs::exists(kept, ignored) && !fs::equivalent(kept, path, ignored))
    kept = path + ".damaged-" + std::to_string(++n);
  for (const char* end : {"", "-wal", "-journal"}) {
    if (!fs::exists(path + end, ignored) || fs::exists(kept + end, ignored)) continue;
    if (::link((path + end).c_str(), (kept + end).c_str()) != 0)
      return system_fault("keep the damaged file as " + kept + end, path);
  }
  return kept;
}

/// Renames the repaired store to its place in one step; before that the log of the damaged one is
/// removed, or SQLite would write it into the new one. In between, the file `repaired_name` marks
/// an unfinished repair.
Expected<std::string> put_in_place(const std::string& path) {
  std::string kept;
  std::error_code ignored;
  if (fs::exists(path, ignored)) {
    auto aside = keep_aside(path);
    if (!aside) return aside;
    kept = std::move(*aside);
    if (auto synced = sync_folder_of(path); !synced) return tl::unexpected(synced.error());
  }
  for (const char* end : {"-wal", "-shm", "-journal"}) {
    if (::unlink((path + end).c_str()) != 0 && errno != ENOENT)
      return system_fault("take away the damaged log", path + end);
  }
  if (auto synced = sync_folder_of(path); !synced) return tl::unexpected(synced.error());
  if (::rename(repaired_name(path).c_str(), path.c_str()) != 0)
    return system_fault("put the repaired store in place", path);
  return sync_folder_of(path).map([&kept] { return kept; });
}

void remove_with_logs(const std::string& path) {
  for (const char* end : {"", "-wal", "-shm", "-journal"}) ::unlink((path + end).c_str());
}

}  // namespace

std::vector<std::string> MapStoreHealth::sentences() const {
  std::vector<std::string> all;
  if (!structure.empty()) all.push_back("the file is damaged: " + structure);
  for (const DamagedVersion& one : damaged)
    all.push_back("version " + number(one.version) + ": " + one.fault);
  all.insert(all.end(), losses.begin(), losses.end());
  return all;
}

Expected<MapStoreHealth> check_map_store(const std::string& path) {
  const auto file = open_damaged(path);
  if (!file) return tl::unexpected(file.error());
  return health_of(*file);
}

Expected<MapStoreHealth> salvage_map_store(const std::string& from, const std::string& to) {
  const auto damaged = open_damaged(from);
  if (!damaged) return tl::unexpected(damaged.error());
  MapStoreHealth health = health_of(*damaged);
  if (health.sound.empty())
    return fail(
        ErrorCode::kInvalid,
        "holds no undamaged version; it was not changed: restore a copy of it, or move it away",
        from);
  auto fresh = SqliteFile::open(to);
  if (!fresh) return tl::unexpected(fresh.error());
  if (auto copied = copy_content(*damaged, health.sound, *fresh); !copied)
    return tl::unexpected(copied.error());
  return health;
}

Expected<MapRepair> repair_map_store(const std::string& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored) && !fs::exists(repaired_name(path), ignored))
    return fail(ErrorCode::kNotFound, "no such map store", path);
  const auto claim = FileClaim::take(path);
  if (!claim) return tl::unexpected(claim.error());
  MapRepair repair;
  if (!fs::exists(repaired_name(path), ignored)) {
    auto found = check_map_store(path);
    if (!found) return tl::unexpected(found.error());
    repair.found = std::move(*found);
    if (repair.found.is_sound()) return repair;
    const std::string part = path + ".salvage";
    remove_with_logs(part);
    const auto salvaged = salvage_map_store(path, part);
    auto owned = salvaged ? same_owner(path, part) : tl::unexpected(salvaged.error());
    if (!owned) {
      remove_with_logs(part);
      return tl::unexpected(owned.error());
    }
    if (::rename(part.c_str(), repaired_name(path).c_str()) != 0)
      return system_fault("name the repaired store", part);
  } else if (auto found = check_map_store(path)) {
    repair.found = std::move(*found);
  }
  auto kept = put_in_place(path);
  if (!kept) return tl::unexpected(kept.error());
  repair.kept_as = std::move(*kept);
  return repair;
}

}  // namespace fiducap
