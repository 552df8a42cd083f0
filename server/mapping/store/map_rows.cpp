#include "mapping/store/map_rows.hpp"

#include <cstddef>
#include <utility>

#include "base/bytes.hpp"
#include "mapping/store/sqlite_file.hpp"

namespace fiducap {

namespace {

constexpr const char* kCreate = R"(
CREATE TABLE version (
  version INTEGER PRIMARY KEY, parent INTEGER NOT NULL, created_utc_ns INTEGER NOT NULL,
  hash TEXT NOT NULL, comment TEXT NOT NULL, family TEXT NOT NULL, reference_tag INTEGER,
  rw_px REAL NOT NULL, rw_py REAL NOT NULL, rw_pz REAL NOT NULL,
  rw_qw REAL NOT NULL, rw_qx REAL NOT NULL, rw_qy REAL NOT NULL, rw_qz REAL NOT NULL) STRICT;
CREATE TABLE tag (
  version INTEGER NOT NULL REFERENCES version(version), tag_id INTEGER NOT NULL,
  edge_m REAL NOT NULL,
  px REAL NOT NULL, py REAL NOT NULL, pz REAL NOT NULL,
  qw REAL NOT NULL, qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL,
  covariance BLOB NOT NULL, state TEXT NOT NULL, first_seen_utc_ns INTEGER NOT NULL,
  last_seen_utc_ns INTEGER NOT NULL, sightings INTEGER NOT NULL, component INTEGER NOT NULL,
  PRIMARY KEY (version, tag_id)) STRICT, WITHOUT ROWID;
CREATE TABLE extrinsics (
  body TEXT NOT NULL, camera INTEGER NOT NULL,
  px REAL NOT NULL, py REAL NOT NULL, pz REAL NOT NULL,
  qw REAL NOT NULL, qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL,
  PRIMARY KEY (body, camera)) STRICT, WITHOUT ROWID;
CREATE TABLE camera_clock (
  body TEXT NOT NULL, camera INTEGER NOT NULL, shift_s REAL NOT NULL, readout_s REAL NOT NULL,
  PRIMARY KEY (body, camera)) STRICT, WITHOUT ROWID;
)";
constexpr const char* kCreateLenses = R"(
CREATE TABLE camera_lens (
  body TEXT NOT NULL, camera INTEGER NOT NULL,
  focal REAL, centre_u_px REAL, centre_v_px REAL, k1 REAL,
  PRIMARY KEY (body, camera)) STRICT, WITHOUT ROWID;
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
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) writer.f64(covariance(row, column));
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
  if (!covariance) return tl::unexpected(covariance.error());
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
      "last_seen_utc_ns, sightings, component FROM tag WHERE version = ? ORDER BY tag_id");
  rows.bind(map.version);
  for (;;) {
    const auto row = rows.step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return {};
    auto entry = tag_from(rows, context);
    if (!entry) return tl::unexpected(entry.error());
    map.tags.push_back(std::move(*entry));
  }
}

Expected<void> save_lens(const SqliteFile& file, const StoredExtrinsics& one) {
  if (one.lens.is_none()) {
    auto remove = file.prepare("DELETE FROM camera_lens WHERE body = ? AND camera = ?");
    return remove.bind(one.body).bind(std::int64_t{one.camera}).run();
  }
  auto insert = file.prepare("INSERT OR REPLACE INTO camera_lens VALUES (?,?, ?,?,?,?)");
  insert.bind(one.body).bind(std::int64_t{one.camera});
  for (const auto& number :
       {one.lens.focal, one.lens.centre_u_px, one.lens.centre_v_px, one.lens.k1})
    number ? insert.bind(*number) : insert.bind_null();
  return insert.run();
}

/// An older store that is only read has no such table.
Expected<void> load_lenses(const SqliteFile& file, std::vector<StoredExtrinsics>& all) {
  const auto tables = file.integer("SELECT count(*) FROM sqlite_master WHERE name = 'camera_lens'");
  if (!tables) return tl::unexpected(tables.error());
  if (*tables == 0) return {};
  auto rows =
      file.prepare("SELECT body, camera, focal, centre_u_px, centre_v_px, k1 FROM camera_lens");
  const auto number = [&](int column) {
    return rows.is_null(column) ? std::nullopt : std::optional(rows.real(column));
  };
  return rows.each_row([&] {
    for (StoredExtrinsics& one : all)
      if (one.body == rows.text(0) && one.camera == static_cast<int>(rows.integer(1)))
        one.lens = {number(2), number(3), number(4), number(5)};
  });
}

}  // namespace

Expected<void> migrate(SqliteFile& file) {
  const auto schema = file.integer("PRAGMA user_version");
  if (!schema) return tl::unexpected(schema.error());
  if (*schema == kMapStoreSchema) return {};
  return file.transaction([&]() -> Expected<void> {
    if (*schema < 2) {
      if (auto created = create_ties(file); !created) return created;
    }
    if (auto created = file.execute(kCreateLenses); !created) return created;
    return file.execute(("PRAGMA user_version = " + std::to_string(kMapStoreSchema)).c_str());
  });
}

Expected<void> create_tables(SqliteFile& file) {
  if (auto created = file.execute(kCreate); !created) return created;
  if (auto created = create_ties(file); !created) return created;
  if (auto created = file.execute(kCreateLenses); !created) return created;
  const std::string marks = "PRAGMA application_id = " + std::to_string(kMapStoreId) +
                            "; PRAGMA user_version = " + std::to_string(kMapStoreSchema);
  return file.execute(marks.c_str());
}

Expected<void> insert_map(const SqliteFile& file, const TagMap& map) {
  if (auto written = insert_version(file, map); !written) return written;
  if (auto written = insert_tags(file, map); !written) return written;
  return insert_ties(file, map);
}

Expected<TagMap> load_map(const SqliteFile& file, std::int64_t version) {
  const std::string context = file.path() + " version " + std::to_string(version);
  auto row = file.prepare(
      "SELECT parent, created_utc_ns, hash, comment, family, reference_tag, "
      "rw_px, rw_py, rw_pz, rw_qw, rw_qx, rw_qy, rw_qz FROM version WHERE version = ?");
  const auto found = row.bind(version).step();
  if (!found) return tl::unexpected(found.error());
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
  if (auto loaded = load_tags(file, map, context); !loaded) return tl::unexpected(loaded.error());
  if (const auto fault = fault_in(map))
    return fail(ErrorCode::kInvalid, "is damaged: " + *fault, context);
  if (const auto hash = content_hash(map); hash != map.hash)
    return fail(ErrorCode::kInvalid,
                "is damaged: its content has hash " + hash + ", stored was " + map.hash +
                    "; go back to another version",
                context);
  if (auto loaded = load_ties(file, map, context); !loaded) return tl::unexpected(loaded.error());
  return map;
}

Expected<void> set_comment(const SqliteFile& file, std::int64_t version,
                           const std::string& comment) {
  auto row = file.prepare("UPDATE version SET comment = ? WHERE version = ? RETURNING version");
  const auto found = row.bind(comment).bind(version).step();
  if (!found) return tl::unexpected(found.error());
  if (*found) return {};
  return fail(ErrorCode::kNotFound, "there is no such version; the log lists them",
              file.path() + " version " + std::to_string(version));
}

Expected<void> remove_map(const SqliteFile& file, std::int64_t version) {
  if (auto done = remove_ties(file, version); !done) return done;
  for (const char* sql :
       {"UPDATE version SET parent = (SELECT parent FROM version WHERE version = "
        "?1) WHERE parent = ?1",
        "DELETE FROM tag WHERE version = ?1", "DELETE FROM version WHERE version = ?1"}) {
    auto statement = file.prepare(sql);
    if (auto done = statement.bind(version).run(); !done) return done;
  }
  return {};
}

Expected<std::vector<MapVersionInfo>> list_maps(const SqliteFile& file) {
  auto rows = file.prepare(
      "SELECT version, parent, created_utc_ns, hash, comment, "
      "(SELECT count(*) FROM tag WHERE tag.version = version.version) FROM version ORDER BY "
      "version DESC");
  std::vector<MapVersionInfo> versions;
  return rows
      .each_row([&] {
        versions.push_back({rows.integer(0), rows.integer(1), rows.integer(2), rows.text(3),
                            rows.text(4), static_cast<int>(rows.integer(5))});
      })
      .map([&] { return std::move(versions); });
}

Expected<void> save_extrinsics(const SqliteFile& file, const StoredExtrinsics& one) {
  auto insert = file.prepare("INSERT OR REPLACE INTO extrinsics VALUES (?,?, ?,?,?,?,?,?,?)");
  insert.bind(one.body).bind(std::int64_t{one.camera});
  bind_pose(insert, one.X_BV);
  if (auto done = insert.run(); !done) return done;
  if (auto done = save_lens(file, one); !done || !one.clock) return done;
  auto clock = file.prepare("INSERT OR REPLACE INTO camera_clock VALUES (?,?,?,?)");
  clock.bind(one.body).bind(std::int64_t{one.camera});
  clock.bind(one.clock->shift_s).bind(one.clock->readout_s);
  return clock.run();
}

Expected<std::vector<StoredExtrinsics>> load_extrinsics(const SqliteFile& file) {
  auto rows = file.prepare(
      "SELECT body, camera, px, py, pz, qw, qx, qy, qz, shift_s, readout_s FROM extrinsics "
      "LEFT JOIN camera_clock USING (body, camera) ORDER BY body, camera");
  std::vector<StoredExtrinsics> all;
  return rows
      .each_row([&] {
        all.push_back({rows.text(0), static_cast<int>(rows.integer(1)), pose_from(rows, 2)});
        if (!rows.is_null(9)) all.back().clock = {rows.real(9), rows.real(10)};
      })
      .and_then([&] { return load_lenses(file, all); })
      .map([&] { return std::move(all); });
}

}  // namespace fiducap
