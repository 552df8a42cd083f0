#include "mapping/store/map_store.hpp"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <utility>

#include "mapping/store/file_claim.hpp"
#include "mapping/store/map_thinning.hpp"
#include "mapping/store/sqlite_file.hpp"
#include "mapping/store/tie_rows.hpp"

namespace fiducap {

namespace {

constexpr const char* kWhatToDo =
    "; it was not changed: `fiducap map repair` saves what is readable; or restore a copy of it, "
    "or "
    "move it away";
constexpr std::size_t kLongestName = 200;
constexpr int kMostThinned = 16;  // at once: beside a commit it takes no time
// What becomes free is used by the next versions; only much of it goes back to the disk.
constexpr std::int64_t kMuchRoom_pages = 4096;

/// SQLite takes a file with less than one page for an empty one and fills a cut last page with
/// zeros. Not ours to repair, unless a log is there: then a crash during its write-back looks the
/// same and SQLite knows how.
Expected<void> check_shape(const SqliteFile& file) {
  const auto shape = file.shape();
  if (!shape) return tl::unexpected(shape.error());
  const auto& head = shape->head;
  // SQLite says 0 of a file of one byte, too.
  if ((shape->bytes == 0 && head[0] == 0) || shape->has_log) return {};
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  if (!std::equal(kMagic.begin(), kMagic.end(), head.begin()))
    return fail(ErrorCode::kInvalid,
                std::string("is damaged or not a map store (no SQLite header)") + kWhatToDo,
                file.path());
  const unsigned stored = head[16] * 256u + head[17];
  const unsigned page = stored == 1 ? 65536u : stored;
  if (page == 0 || shape->bytes % page != 0) {
    return fail(ErrorCode::kInvalid, std::string("is damaged (cut off inside a page)") + kWhatToDo,
                file.path());
  }
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
  if (*application != kMapStoreId) {
    return fail(
        ErrorCode::kUnsupported,
        "is a database of another program; it was not changed, give the map store another path",
        file.path());
  }
  if (*schema > kMapStoreSchema) {
    return fail(ErrorCode::kUnsupported,
                "was written by a newer Fiducap (schema " + std::to_string(*schema) +
                    ", this one knows up to " + std::to_string(kMapStoreSchema) +
                    "); update Fiducap or give another path",
                file.path());
  }
  if (*schema < 1)
    return fail(ErrorCode::kInvalid,
                "is damaged (schema " + std::to_string(*schema) + ")" + kWhatToDo, file.path());
  return false;
}

/// Nothing of the file is touched before it is known to be ours and sound.
Expected<bool> is_fresh(const SqliteFile& file) {
  auto fresh = check_kind(file);
  if (!fresh || *fresh) return fresh;
  const auto broken = file.structural_fault();
  if (!broken) return tl::unexpected(broken.error());
  if (!broken->empty())
    return fail(ErrorCode::kInvalid, "is damaged (" + *broken + ")" + kWhatToDo, file.path());
  return false;
}

Expected<void> set_up(SqliteFile& file, bool fresh) {
  // EXTRA: the rollback journal of the first page does not come back after a power cut, when it
  // would undo everything. With a write-ahead log it is the same as FULL.
  if (auto set = file.execute("PRAGMA synchronous = EXTRA; PRAGMA foreign_keys = ON"); !set)
    return set;
  // Only an empty file can be told that its pages may be given back.
  if (fresh) {
    if (auto set = file.execute("PRAGMA auto_vacuum = INCREMENTAL"); !set) return set;
  }
  const auto mode = file.text("PRAGMA journal_mode = WAL");
  if (!mode) return tl::unexpected(mode.error());
  if (*mode != "wal") {
    return fail(ErrorCode::kUnavailable,
                "this disk cannot keep a write-ahead log (journal mode stays " + *mode + ")",
                file.path());
  }
  // A long reader may make the log grow; afterwards it is cut to 8 MB.
  if (auto set = file.execute("PRAGMA journal_size_limit = 8388608"); !set) return set;
  if (!fresh) return migrate(file);
  auto transaction = SqliteTransaction::begin(file);
  if (!transaction) return tl::unexpected(transaction.error());
  if (auto created = create_tables(file); !created) return created;
  return transaction->commit();
}

Expected<std::vector<VersionAge>> ages_of(const SqliteFile& file) {
  auto rows = file.prepare(
      "SELECT version, created_utc_ns, comment = ? FROM version ORDER BY version DESC");
  rows.bind(std::string(kAutomaticComment));
  std::vector<VersionAge> ages;
  for (;;) {
    const auto row = rows.step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return ages;
    ages.push_back({rows.integer(0), rows.integer(1), rows.integer(2) != 0});
  }
}

/// Those whose content is what was stored: a damaged one is for a person to look at.
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

Expected<void> give_back_room(SqliteFile& file) {
  const auto free = file.integer("PRAGMA freelist_count");
  if (!free) return tl::unexpected(free.error());
  return *free < kMuchRoom_pages ? Expected<void>{}
                                 : file.execute("PRAGMA incremental_vacuum(512)");
}

}  // namespace

class MapStore::Impl {
 public:
  explicit Impl(SqliteFile opened) : file(std::move(opened)) {}
  SqliteFile file;
  std::optional<FileClaim> claim{};
};

MapStore::MapStore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
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
  return MapStore(std::make_unique<Impl>(std::move(*file)));
}

Expected<MapStore> MapStore::open_to_read(const std::string& path) {
  auto file = SqliteFile::open(path, SqliteFile::Access::kSalvage);
  if (!file) return tl::unexpected(file.error());
  if (const auto fresh = check_kind(*file); !fresh) return tl::unexpected(fresh.error());
  return MapStore(std::make_unique<Impl>(std::move(*file)));
}

Expected<void> MapStore::claim() {
  auto claim = FileClaim::take(impl_->file.path());
  if (!claim) return tl::unexpected(claim.error());
  impl_->claim.emplace(std::move(*claim));
  return {};
}

Expected<TagMap> MapStore::commit(const TagMap& map, const std::string& comment) {
  SqliteFile& file = impl_->file;
  if (const auto fault = fault_in(map))
    return fail(ErrorCode::kInvalid, "not stored: " + *fault, file.path());
  auto transaction = SqliteTransaction::begin(file);
  if (!transaction) return tl::unexpected(transaction.error());
  const auto newest_version = file.integer("SELECT coalesce(max(version), 0) FROM version");
  if (!newest_version) return tl::unexpected(newest_version.error());

  TagMap stored = map;
  stored.version = *newest_version + 1;
  // A map from elsewhere may carry a number this store never gave out.
  stored.parent = map.version >= 1 && map.version <= *newest_version ? map.version : 0;
  stored.comment = comment;
  stored.hash = content_hash(stored);
  if (auto written = insert_map(file, stored); !written) return tl::unexpected(written.error());
  if (auto removed = remove_old_ties(file, stored.version, kAutomaticComment); !removed)
    return tl::unexpected(removed.error());
  if (auto done = transaction->commit(); !done) return tl::unexpected(done.error());
  return stored;
}

Expected<void> check_version_name(const std::string& name) {
  const bool has_control =
      std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; });
  if (name.empty() || name.size() > kLongestName || has_control)
    return fail(ErrorCode::kInvalid, "a version's name must have 1 to 200 characters in one line");
  if (name == kAutomaticComment)
    return fail(ErrorCode::kInvalid, "this name marks versions that the server stored by itself");
  return {};
}

Expected<void> MapStore::name_version(std::int64_t version, const std::string& name) {
  if (auto good = check_version_name(name); !good) return good;
  auto transaction = SqliteTransaction::begin(impl_->file);
  if (!transaction) return tl::unexpected(transaction.error());
  if (auto set = set_comment(impl_->file, version, name); !set) return set;
  return transaction->commit();
}

Expected<int> MapStore::thin() {
  SqliteFile& file = impl_->file;
  const auto ages = ages_of(file);
  if (!ages) return tl::unexpected(ages.error());
  const auto going = few_sound(file, versions_to_thin(*ages));
  if (!going) return tl::unexpected(going.error());
  if (going->empty()) return 0;
  auto transaction = SqliteTransaction::begin(file);
  if (!transaction) return tl::unexpected(transaction.error());
  for (const std::int64_t version : *going) {
    if (auto removed = remove_map(file, version); !removed) return tl::unexpected(removed.error());
  }
  if (auto given = give_back_room(file); !given) return tl::unexpected(given.error());
  if (auto done = transaction->commit(); !done) return tl::unexpected(done.error());
  return static_cast<int>(going->size());
}

Expected<TagMap> MapStore::newest() const {
  const auto version = impl_->file.integer("SELECT coalesce(max(version), 0) FROM version");
  if (!version) return tl::unexpected(version.error());
  return *version == 0 ? Expected<TagMap>(TagMap{}) : load(*version);
}

Expected<SoundVersion> MapStore::newest_sound() const {
  const auto ages = ages_of(impl_->file);
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
  return fail(ErrorCode::kInvalid,
              "is damaged in every one of its " + std::to_string(sound.damaged.size()) +
                  " versions" + kWhatToDo,
              impl_->file.path());
}

Expected<TagMap> MapStore::load(std::int64_t version) const {
  return load_map(impl_->file, version);
}

Expected<std::vector<MapVersionInfo>> MapStore::log() const { return list_maps(impl_->file); }

Expected<void> MapStore::save_extrinsics(const StoredExtrinsics& extrinsics) {
  auto transaction = SqliteTransaction::begin(impl_->file);
  if (!transaction) return tl::unexpected(transaction.error());
  if (auto saved = fiducap::save_extrinsics(impl_->file, extrinsics); !saved) return saved;
  return transaction->commit();
}

Expected<std::vector<StoredExtrinsics>> MapStore::extrinsics() const {
  return load_extrinsics(impl_->file);
}

}  // namespace fiducap
