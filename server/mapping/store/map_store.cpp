#include "mapping/store/map_store.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "base/text.hpp"
#include "mapping/store/file_claim.hpp"
#include "mapping/store/sqlite_file.hpp"

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

constexpr const char* kWhatToDo =
    "; it was not changed: `fiducap map repair` saves its readable part; or restore a copy of it, "
    "or move it away";
constexpr std::size_t kLongestName = 200;
constexpr int kMostThinned = 16;  // at once: short compared with a commit
// Free pages are used by the next versions; more than this are returned to the disk.
constexpr std::int64_t kMostFree_pages = 4096;

tl::unexpected<Error> damaged(const SqliteFile& file, const std::string& how) {
  return fail(ErrorCode::kInvalid, "is damaged " + how + kWhatToDo, file.path());
}

/// SQLite takes a file with less than one page for an empty one and fills a cut last page with
/// zeros. That is refused, unless a log is there: SQLite repairs a crash during its write-back,
/// which looks the same.
Expected<void> check_shape(const SqliteFile& file) {
  const auto shape = file.shape();
  if (!shape) return tl::unexpected(shape.error());
  const auto& head = shape->head;
  // SQLite reports 0 for a file of one byte, too.
  if ((shape->bytes == 0 && head[0] == 0) || shape->has_log) return {};
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  if (!std::equal(kMagic.begin(), kMagic.end(), head.begin()))
    return damaged(file, "or not a map store (no SQLite header)");
  const unsigned stored = head[16] * 256u + head[17];
  const unsigned page = stored == 1 ? 65536u : stored;
  if (page == 0 || shape->bytes % page != 0) return damaged(file, "(cut off inside a page)");
  return {};
}

/// @return true for a file without content, false for a store; Error for anything else
Expected<bool> check_kind(const SqliteFile& file) {
  const auto application = file.integer("PRAGMA application_id");
  if (!application) return tl::unexpected(application.error());
  const auto schema = file.integer("PRAGMA user_version");
  if (!schema) return tl::unexpected(schema.error());
  const auto objects = file.integer("SELECT count(*) FROM sqlite_master");
  if (!objects) return tl::unexpected(objects.error());
  if (*application == 0 && *schema == 0 && *objects == 0) return true;
  if (*application != kMapStoreId)
    return fail(
        ErrorCode::kUnsupported,
        "is a database of another program; it was not changed, give the map store another path",
        file.path());
  if (*schema > kMapStoreSchema)
    return fail(ErrorCode::kUnsupported,
                "was written by a newer Fiducap (schema " + std::to_string(*schema) +
                    ", this one knows up to " + std::to_string(kMapStoreSchema) +
                    "); update Fiducap or give another path",
                file.path());
  if (*schema < 1) return damaged(file, "(schema " + std::to_string(*schema) + ")");
  const auto definition = file.definition();
  if (!definition) return tl::unexpected(definition.error());
  if (!definition->empty())
    return fail(ErrorCode::kInvalid,
                "has a " + *definition + ", which no map store has; it was not run", file.path());
  return false;
}

/// The file is not changed before it is known to be a sound map store.
Expected<bool> is_fresh(const SqliteFile& file) {
  auto fresh = check_kind(file);
  if (!fresh || *fresh) return fresh;
  const auto broken = file.structural_fault();
  if (!broken) return tl::unexpected(broken.error());
  if (!broken->empty()) return damaged(file, "(" + *broken + ")");
  return false;
}

Expected<void> set_up(SqliteFile& file, bool fresh) {
  // EXTRA: the rollback journal of the first page does not reappear after a power cut, which would
  // undo everything. With a write-ahead log it is the same as FULL.
  if (auto set = file.execute("PRAGMA synchronous = EXTRA; PRAGMA foreign_keys = ON"); !set)
    return set;
  // Can be set for an empty file only.
  if (fresh) {
    if (auto set = file.execute("PRAGMA auto_vacuum = INCREMENTAL"); !set) return set;
  }
  const auto mode = file.text("PRAGMA journal_mode = WAL");
  if (!mode) return tl::unexpected(mode.error());
  if (*mode != "wal")
    return fail(ErrorCode::kUnavailable,
                "this disk cannot keep a write-ahead log (journal mode stays " + *mode + ")",
                file.path());
  // A long reader may make the log grow; afterwards it is cut to 8 MB.
  if (auto set = file.execute("PRAGMA journal_size_limit = 8388608"); !set) return set;
  if (!fresh) return migrate(file);
  return file.transaction([&] { return create_tables(file); });
}

Expected<std::vector<VersionAge>> ages_of(const SqliteFile& file) {
  auto rows = file.prepare(
      "SELECT version, created_utc_ns, comment = ? FROM version ORDER BY version DESC");
  rows.bind(std::string(kAutomaticComment));
  std::vector<VersionAge> ages;
  return rows
      .each_row([&] {
        ages.push_back({rows.integer(0), rows.integer(1), rows.integer(2) != 0});
      })
      .map([&] { return std::move(ages); });
}

/// The undamaged ones: a damaged one is left to the user.
Expected<std::vector<std::int64_t>> few_sound(const SqliteFile& file,
                                              const std::vector<std::int64_t>& versions) {
  std::vector<std::int64_t> few;
  for (const std::int64_t version : versions) {
    if (few.size() == kMostThinned) break;
    const auto map = load_map(file, version);
    if (map)
      few.push_back(version);
    else if (map.error().code != ErrorCode::kInvalid)
      return tl::unexpected(map.error());
  }
  return few;
}

Expected<void> return_free_pages(SqliteFile& file) {
  const auto free = file.integer("PRAGMA freelist_count");
  if (!free) return tl::unexpected(free.error());
  return *free < kMostFree_pages ? Expected<void>{}
                                 : file.execute("PRAGMA incremental_vacuum(512)");
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

MapStore::MapStore(SqliteFile file) : file_(std::make_unique<SqliteFile>(std::move(file))) {}
MapStore::~MapStore() = default;
MapStore::MapStore(MapStore&&) noexcept = default;
MapStore& MapStore::operator=(MapStore&&) noexcept = default;

std::string repaired_name(const std::string& path) { return path + ".repaired"; }

Expected<MapStore> MapStore::open(const std::string& path) {
  std::error_code unknown;
  if (std::filesystem::exists(repaired_name(path), unknown))
    return fail(ErrorCode::kInvalid,
                "was being repaired when that was interrupted: `fiducap map repair` finishes it",
                path);
  auto file = SqliteFile::open(path);
  if (!file) return tl::unexpected(file.error());
  file->write_back_on_close(false);
  if (auto shape = check_shape(*file); !shape) return tl::unexpected(shape.error());
  const auto fresh = is_fresh(*file);
  if (!fresh) return tl::unexpected(fresh.error());
  if (auto ready = set_up(*file, *fresh); !ready) return tl::unexpected(ready.error());
  file->write_back_on_close(true);
  return MapStore(std::move(*file));
}

Expected<MapBackup> MapStore::back_up(const std::string& path, const std::string& to) {
  namespace fs = std::filesystem;
  const auto source = open_to_read(path);
  if (!source) return tl::unexpected(source.error());
  // SQLite opens by name: an empty file of our own is there first.
  std::string part = to + ".partXXXXXX";
  const int made = ::mkostemp(part.data(), O_CLOEXEC);
  if (made < 0)
    return fail(ErrorCode::kUnavailable, std::string("cannot be written: ") + std::strerror(errno),
                to);
  ::close(made);
  const auto copied = [&]() -> Expected<MapBackup> {
    auto copy = SqliteFile::open(part);
    if (!copy) return tl::unexpected(copy.error());
    if (auto done = source->file_->copy_to(*copy); !done) return tl::unexpected(done.error());
    const auto fault = copy->structural_fault();
    if (!fault) return tl::unexpected(fault.error());
    if (!fault->empty()) return damaged(*source->file_, "(" + *fault + ")");
    const MapStore stored(std::move(*copy));
    const auto versions = stored.log();
    if (!versions) return tl::unexpected(versions.error());
    const auto sound = stored.newest_sound();
    if (!sound) return tl::unexpected(sound.error());
    return MapBackup{versions->size(), sound->map.version, sound->damaged};
  }();
  std::error_code error;
  if (copied) fs::permissions(part, fs::status(path, error).permissions(), error);
  if (copied && !error) fs::rename(part, to, error);
  if (copied && !error) return copied;
  const std::string why = error.message();
  fs::remove(part, error);
  if (!copied) return copied;
  return fail(ErrorCode::kUnavailable, "cannot be written: " + why, to);
}

Expected<MapStore> MapStore::open_to_read(const std::string& path) {
  auto file = SqliteFile::open(path, SqliteFile::Access::kSalvage);
  if (!file) return tl::unexpected(file.error());
  if (const auto fresh = check_kind(*file); !fresh) return tl::unexpected(fresh.error());
  return MapStore(std::move(*file));
}

Expected<void> MapStore::claim() {
  auto claim = FileClaim::take(file_->path());
  if (!claim) return tl::unexpected(claim.error());
  claim_ = std::make_unique<FileClaim>(std::move(*claim));
  return {};
}

Expected<TagMap> MapStore::commit(const TagMap& map, const std::string& comment) {
  SqliteFile& file = *file_;
  if (const auto fault = fault_in(map))
    return fail(ErrorCode::kInvalid, "not stored: " + *fault, file.path());
  TagMap stored = map;
  const auto done = file.transaction([&]() -> Expected<void> {
    const auto newest_version = file.integer("SELECT coalesce(max(version), 0) FROM version");
    if (!newest_version) return tl::unexpected(newest_version.error());
    stored.version = *newest_version + 1;
    // A map from elsewhere may have a number that this store never assigned.
    stored.parent = map.version >= 1 && map.version <= *newest_version ? map.version : 0;
    stored.comment = comment;
    stored.hash = content_hash(stored);
    if (auto written = insert_map(file, stored); !written) return written;
    return remove_old_ties(file, stored.version, kAutomaticComment);
  });
  return done.map([&] { return std::move(stored); });
}

Expected<void> check_version_name(const std::string& name) {
  if (name.empty() || name.size() > kLongestName || printable(name) != name)
    return fail(ErrorCode::kInvalid, "a version's name must have 1 to 200 characters in one line");
  if (name == kAutomaticComment)
    return fail(ErrorCode::kInvalid, "this name marks versions that the server stored by itself");
  return {};
}

Expected<void> MapStore::name_version(std::int64_t version, const std::string& name) {
  if (auto good = check_version_name(name); !good) return good;
  return file_->transaction([&] { return set_comment(*file_, version, name); });
}

Expected<int> MapStore::thin() {
  SqliteFile& file = *file_;
  const auto ages = ages_of(file);
  if (!ages) return tl::unexpected(ages.error());
  const auto going = few_sound(file, versions_to_thin(*ages));
  if (!going) return tl::unexpected(going.error());
  if (going->empty()) return 0;
  const auto done = file.transaction([&]() -> Expected<void> {
    for (const std::int64_t version : *going)
      if (auto removed = remove_map(file, version); !removed) return removed;
    return return_free_pages(file);
  });
  return done.map([&] { return static_cast<int>(going->size()); });
}

Expected<TagMap> MapStore::newest() const {
  const auto version = file_->integer("SELECT coalesce(max(version), 0) FROM version");
  if (!version) return tl::unexpected(version.error());
  return *version == 0 ? Expected<TagMap>(TagMap{}) : load(*version);
}

Expected<SoundVersion> MapStore::newest_sound() const {
  const auto ages = ages_of(*file_);
  if (!ages) return tl::unexpected(ages.error());
  SoundVersion sound;
  for (const VersionAge& one : *ages) {
    auto map = load(one.version);
    if (map) {
      sound.map = std::move(*map);
      return sound;
    }
    if (map.error().code != ErrorCode::kInvalid) return tl::unexpected(map.error());
    sound.damaged.push_back({one.version, map.error().what});
  }
  if (sound.damaged.empty()) return sound;
  return damaged(*file_,
                 "in every one of its " + std::to_string(sound.damaged.size()) + " versions");
}

Expected<TagMap> MapStore::load(std::int64_t version) const { return load_map(*file_, version); }

Expected<std::vector<MapVersionInfo>> MapStore::log() const { return list_maps(*file_); }

Expected<void> MapStore::save_extrinsics(const StoredExtrinsics& extrinsics) {
  return file_->transaction([&] { return fiducap::save_extrinsics(*file_, extrinsics); });
}

Expected<std::vector<StoredExtrinsics>> MapStore::extrinsics() const {
  return load_extrinsics(*file_);
}

}  // namespace fiducap
