#include "mapping/map_store.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <utility>

#include "base/byte_reader.hpp"
#include "base/byte_writer.hpp"
#include "mapping/file_claim.hpp"
#include "mapping/sqlite_file.hpp"

namespace fiducap {

namespace {

constexpr std::int64_t kApplicationId = 0x46444350;  // "FDCP"
constexpr std::int64_t kSchema = 1;
constexpr const char* kWhatToDo = "; it was not changed: restore a copy of it, or move it away";

constexpr const char* kCreate = R"(
CREATE TABLE IF NOT EXISTS version (
  version INTEGER PRIMARY KEY, parent INTEGER NOT NULL, created_utc_ns INTEGER NOT NULL,
  hash TEXT NOT NULL, comment TEXT NOT NULL, family TEXT NOT NULL, reference_tag INTEGER,
  rw_px REAL NOT NULL, rw_py REAL NOT NULL, rw_pz REAL NOT NULL,
  rw_qw REAL NOT NULL, rw_qx REAL NOT NULL, rw_qy REAL NOT NULL, rw_qz REAL NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS tag (
  version INTEGER NOT NULL REFERENCES version(version), tag_id INTEGER NOT NULL,
  edge_m REAL NOT NULL,
  px REAL NOT NULL, py REAL NOT NULL, pz REAL NOT NULL,
  qw REAL NOT NULL, qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL,
  covariance BLOB NOT NULL, state TEXT NOT NULL, first_seen_utc_ns INTEGER NOT NULL,
  last_seen_utc_ns INTEGER NOT NULL, sightings INTEGER NOT NULL, component INTEGER NOT NULL,
  PRIMARY KEY (version, tag_id)) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS extrinsics (
  body TEXT NOT NULL, camera INTEGER NOT NULL,
  px REAL NOT NULL, py REAL NOT NULL, pz REAL NOT NULL,
  qw REAL NOT NULL, qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL,
  PRIMARY KEY (body, camera)) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS camera_clock (
  body TEXT NOT NULL, camera INTEGER NOT NULL, shift_s REAL NOT NULL, readout_s REAL NOT NULL,
  PRIMARY KEY (body, camera)) STRICT, WITHOUT ROWID;
PRAGMA application_id = 0x46444350;
PRAGMA user_version = 1;
)";

void bind_pose(SqliteStatement& statement, const Pose& pose) {
  for (const double v :
       {pose.p.x(), pose.p.y(), pose.p.z(), pose.q.w(), pose.q.x(), pose.q.y(), pose.q.z()}) {
    statement.bind(v);
  }
}

Pose pose_from(const SqliteStatement& row, int column) {
  Pose pose;
  pose.p = {row.real(column), row.real(column + 1), row.real(column + 2)};
  pose.q = {row.real(column + 3), row.real(column + 4), row.real(column + 5), row.real(column + 6)};
  return pose;
}

/// Upper triangle, row by row, 21 little-endian doubles.
std::vector<std::byte> covariance_bytes(const Matrix6d& covariance) {
  std::vector<std::byte> bytes;
  ByteWriter<std::endian::little> writer(bytes);
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) writer.f64(covariance(row, column));
  }
  return bytes;
}

Expected<Matrix6d> covariance_from(const std::vector<std::byte>& bytes,
                                   const std::string& context) {
  LittleEndianReader reader(bytes);
  Matrix6d covariance;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column)
      covariance(row, column) = covariance(column, row) = reader.f64();
  }
  return reader.check(context).map([&covariance] { return covariance; });
}

tl::unexpected<Error> pass_on(const Error& error) { return tl::unexpected<Error>(error); }

/// SQLite takes a file with less than one page for an empty one and fills a cut last page with
/// zeros. Not ours to repair, unless a write-ahead log is there: then a crash during its write-back
/// looks the same and SQLite knows how.
Expected<void> check_shape(const std::string& path) {
  std::error_code absent;
  const auto size = std::filesystem::file_size(path, absent);
  if (absent || size == 0) return {};
  const auto log_size = std::filesystem::file_size(path + "-wal", absent);
  if (!absent && log_size > 0) return {};
  std::array<char, 18> head{};
  std::ifstream(path, std::ios::binary).read(head.data(), head.size());
  if (std::string_view(head.data(), 16) != std::string_view("SQLite format 3\0", 16)) {
    return fail(ErrorCode::kInvalid,
                std::string("is damaged or not a map store (no SQLite header)") + kWhatToDo, path);
  }
  const auto high = static_cast<unsigned char>(head[16]);
  const auto low = static_cast<unsigned char>(head[17]);
  const unsigned page = high * 256u + low == 1 ? 65536u : high * 256u + low;
  if (page == 0 || size % page != 0) {
    return fail(ErrorCode::kInvalid, std::string("is damaged (cut off inside a page)") + kWhatToDo,
                path);
  }
  return {};
}

/// Nothing of the file is touched before it is known to be ours and sound.
Expected<bool> is_fresh(const SqliteFile& file) {
  const auto application = file.integer("PRAGMA application_id");
  if (!application) return pass_on(application.error());
  const auto schema = file.integer("PRAGMA user_version");
  if (!schema) return pass_on(schema.error());
  const auto objects = file.integer("SELECT count(*) FROM sqlite_master");
  if (!objects) return pass_on(objects.error());
  if (*application == 0 && *schema == 0 && *objects == 0) return true;
  if (*application != kApplicationId) {
    return fail(
        ErrorCode::kInvalid,
        "is a database of another program; it was not changed, give the map store another path",
        file.path());
  }
  if (*schema > kSchema) {
    return fail(ErrorCode::kUnsupported,
                "was written by a newer Fiducap (schema " + std::to_string(*schema) +
                    ", this one knows up to " + std::to_string(kSchema) +
                    "); update Fiducap or give another path",
                file.path());
  }
  const auto verdict = file.text("PRAGMA quick_check(1)");
  if (!verdict) return pass_on(verdict.error());
  if (*verdict != "ok" || *schema != kSchema) {
    return fail(ErrorCode::kInvalid, "is damaged (" + *verdict + ")" + kWhatToDo, file.path());
  }
  return false;
}

Expected<void> set_up(SqliteFile& file, bool fresh) {
  const auto mode = file.text("PRAGMA journal_mode = WAL");
  if (!mode) return pass_on(mode.error());
  if (*mode != "wal") {
    return fail(ErrorCode::kUnavailable,
                "this disk cannot keep a write-ahead log (journal mode stays " + *mode + ")",
                file.path());
  }
  if (auto set = file.execute("PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON");
      !set || !fresh)
    return set;
  auto transaction = SqliteTransaction::begin(file);
  if (!transaction) return pass_on(transaction.error());
  if (auto created = file.execute(kCreate); !created) return created;
  return transaction->commit();
}

Expected<void> insert_version(const SqliteFile& file, const TagMap& map) {
  auto insert = file.prepare("INSERT INTO version VALUES (?,?,?,?,?,?,?, ?,?,?,?,?,?,?)");
  insert.bind(map.version)
      .bind(map.parent)
      .bind(map.created_utc_ns)
      .bind(map.hash)
      .bind(map.comment)
      .bind(map.family);
  map.reference_tag ? insert.bind(std::int64_t{*map.reference_tag}) : insert.bind_null();
  bind_pose(insert, map.X_RW);
  return insert.run();
}

Expected<void> insert_tags(const SqliteFile& file, const TagMap& map) {
  auto insert = file.prepare("INSERT INTO tag VALUES (?,?,?, ?,?,?,?,?,?,?, ?,?,?,?,?,?)");
  for (const MapTag& entry : map.tags) {
    insert.bind(map.version).bind(std::int64_t{entry.tag.tag_id}).bind(entry.tag.edge_m);
    bind_pose(insert, entry.tag.X_WT);
    insert.bind(covariance_bytes(entry.tag.covariance)).bind(std::string(name_of(entry.state)));
    insert.bind(entry.first_seen_utc_ns).bind(entry.last_seen_utc_ns);
    insert.bind(std::int64_t{entry.sightings}).bind(std::int64_t{entry.component});
    if (auto inserted = insert.run(); !inserted) return inserted;
  }
  return {};
}

Expected<MapTag> tag_from(const SqliteStatement& row, const std::string& context) {
  MapTag entry;
  entry.tag.tag_id = static_cast<int>(row.integer(0));
  entry.tag.edge_m = row.real(1);
  entry.tag.X_WT = pose_from(row, 2);
  auto covariance = covariance_from(row.blob(9), context);
  if (!covariance) return pass_on(covariance.error());
  entry.tag.covariance = *covariance;
  const auto state = tag_state_from(row.text(10));
  if (!state)
    return fail(ErrorCode::kInvalid, "tag state '" + row.text(10) + "' is not known", context);
  entry.state = *state;
  entry.first_seen_utc_ns = row.integer(11);
  entry.last_seen_utc_ns = row.integer(12);
  entry.sightings = static_cast<int>(row.integer(13));
  entry.component = static_cast<int>(row.integer(14));
  return entry;
}

Expected<void> load_tags(const SqliteFile& file, TagMap& map, const std::string& context) {
  auto rows = file.prepare(
      "SELECT tag_id, edge_m, px, py, pz, qw, qx, qy, qz, covariance, state, first_seen_utc_ns, "
      "last_seen_utc_ns, "
      "sightings, component FROM tag WHERE version = ? ORDER BY tag_id");
  rows.bind(map.version);
  for (;;) {
    const auto row = rows.step();
    if (!row) return pass_on(row.error());
    if (!*row) return {};
    auto entry = tag_from(rows, context);
    if (!entry) return pass_on(entry.error());
    map.tags.push_back(std::move(*entry));
  }
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

Expected<MapStore> MapStore::open(const std::string& path) {
  if (auto shape = check_shape(path); !shape) return pass_on(shape.error());
  auto file = SqliteFile::open(path);
  if (!file) return pass_on(file.error());
  file->write_back_on_close(false);
  const auto fresh = is_fresh(*file);
  if (!fresh) return pass_on(fresh.error());
  if (auto ready = set_up(*file, *fresh); !ready) return pass_on(ready.error());
  file->write_back_on_close(true);
  return MapStore(std::make_unique<Impl>(std::move(*file)));
}

Expected<void> MapStore::claim() {
  auto claim = FileClaim::take(impl_->file.path());
  if (!claim) return pass_on(claim.error());
  impl_->claim.emplace(std::move(*claim));
  return {};
}

Expected<TagMap> MapStore::commit(const TagMap& map, const std::string& comment) {
  SqliteFile& file = impl_->file;
  if (const auto fault = fault_in(map))
    return fail(ErrorCode::kInvalid, "not stored: " + *fault, file.path());
  auto transaction = SqliteTransaction::begin(file);
  if (!transaction) return pass_on(transaction.error());
  const auto newest_version = file.integer("SELECT coalesce(max(version), 0) FROM version");
  if (!newest_version) return pass_on(newest_version.error());

  TagMap stored = map;
  stored.version = *newest_version + 1;
  // A map from elsewhere may carry a number this store never gave out.
  stored.parent = map.version >= 1 && map.version <= *newest_version ? map.version : 0;
  stored.comment = comment;
  stored.hash = content_hash(stored);
  if (auto written = insert_version(file, stored); !written) return pass_on(written.error());
  if (auto written = insert_tags(file, stored); !written) return pass_on(written.error());
  if (auto done = transaction->commit(); !done) return pass_on(done.error());
  return stored;
}

Expected<TagMap> MapStore::newest() const {
  const auto version = impl_->file.integer("SELECT coalesce(max(version), 0) FROM version");
  if (!version) return pass_on(version.error());
  return *version == 0 ? Expected<TagMap>(TagMap{}) : load(*version);
}

Expected<TagMap> MapStore::load(std::int64_t version) const {
  const std::string context = impl_->file.path() + " version " + std::to_string(version);
  auto row = impl_->file.prepare(
      "SELECT parent, created_utc_ns, hash, comment, family, reference_tag, "
      "rw_px, rw_py, rw_pz, rw_qw, rw_qx, rw_qy, rw_qz FROM version WHERE version = ?");
  const auto found = row.bind(version).step();
  if (!found) return pass_on(found.error());
  if (!*found)
    return fail(ErrorCode::kNotFound, "there is no such version; the log lists them", context);
  TagMap map;
  map.version = version;
  map.parent = row.integer(0);
  map.created_utc_ns = row.integer(1);
  map.hash = row.text(2);
  map.comment = row.text(3);
  map.family = row.text(4);
  if (!row.is_null(5)) map.reference_tag = static_cast<int>(row.integer(5));
  map.X_RW = pose_from(row, 6);
  if (auto loaded = load_tags(impl_->file, map, context); !loaded) return pass_on(loaded.error());
  if (const auto fault = fault_in(map))
    return fail(ErrorCode::kInvalid, "is damaged: " + *fault, context);
  if (const auto hash = content_hash(map); hash != map.hash) {
    return fail(ErrorCode::kInvalid,
                "is damaged: its content has hash " + hash + ", stored was " + map.hash +
                    "; go back to another version",
                context);
  }
  return map;
}

Expected<std::vector<MapVersionInfo>> MapStore::log() const {
  auto rows = impl_->file.prepare(
      "SELECT version, parent, created_utc_ns, hash, comment, "
      "(SELECT count(*) FROM tag WHERE tag.version = version.version) FROM version ORDER BY "
      "version DESC");
  std::vector<MapVersionInfo> versions;
  for (;;) {
    const auto row = rows.step();
    if (!row) return pass_on(row.error());
    if (!*row) return versions;
    versions.push_back({rows.integer(0), rows.integer(1), rows.integer(2), rows.text(3),
                        rows.text(4), static_cast<int>(rows.integer(5))});
  }
}

Expected<void> MapStore::save_extrinsics(const StoredExtrinsics& extrinsics) {
  auto insert =
      impl_->file.prepare("INSERT OR REPLACE INTO extrinsics VALUES (?,?, ?,?,?,?,?,?,?)");
  insert.bind(extrinsics.body).bind(std::int64_t{extrinsics.camera});
  bind_pose(insert, extrinsics.X_BV);
  if (auto done = insert.run(); !done || !extrinsics.clock) return done;
  auto clock = impl_->file.prepare("INSERT OR REPLACE INTO camera_clock VALUES (?,?,?,?)");
  clock.bind(extrinsics.body).bind(std::int64_t{extrinsics.camera});
  clock.bind(extrinsics.clock->shift_s).bind(extrinsics.clock->readout_s);
  return clock.run();
}

Expected<std::vector<StoredExtrinsics>> MapStore::extrinsics() const {
  auto rows = impl_->file.prepare(
      "SELECT body, camera, px, py, pz, qw, qx, qy, qz, shift_s, readout_s FROM extrinsics "
      "LEFT JOIN camera_clock USING (body, camera) ORDER BY body, camera");
  std::vector<StoredExtrinsics> all;
  for (;;) {
    const auto row = rows.step();
    if (!row) return pass_on(row.error());
    if (!*row) return all;
    all.push_back({rows.text(0), static_cast<int>(rows.integer(1)), pose_from(rows, 2)});
    if (!rows.is_null(9)) all.back().clock = {rows.real(9), rows.real(10)};
  }
}

}  // namespace fiducap
