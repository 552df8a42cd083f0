#include "mapping/store/map_rows.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "base/bytes.hpp"
#include "mapping/store/sqlite_file.hpp"

namespace fiducap {

namespace {

constexpr const char* kCreateTies = R"(
CREATE TABLE tie (
  version INTEGER PRIMARY KEY REFERENCES version(version), hash TEXT NOT NULL,
  content BLOB NOT NULL) STRICT;
)";
constexpr std::size_t kBytesOfTag = 4;
constexpr std::size_t kBytesOfPair = 2 * 4 + 36 * 8;

/// Number of tags, their ids; number of pairs, of each both ids and 36 numbers by rows; number of
/// tags of another size than configured, their ids (not in older rows). Little endian.
std::vector<std::byte> bytes_of(const KnownMap& known) {
  std::vector<std::byte> bytes;
  bytes.reserve(12 + kBytesOfTag * (known.tags.size() + known.wrong_prints.size()) +
                kBytesOfPair * known.pairs.size());
  ByteWriter<std::endian::little> writer(bytes);
  writer.u32(static_cast<std::uint32_t>(known.tags.size()));
  for (const KnownTag& tag : known.tags) writer.i32(tag.tag_id);
  writer.u32(static_cast<std::uint32_t>(known.pairs.size()));
  for (const KnownPair& pair : known.pairs) {
    writer.i32(pair.first_id).i32(pair.second_id);
    for (int row = 0; row < 6; ++row)
      for (int column = 0; column < 6; ++column) writer.f64(pair.covariance(row, column));
  }
  writer.u32(static_cast<std::uint32_t>(known.wrong_prints.size()));
  for (const int tag_id : known.wrong_prints) writer.i32(tag_id);
  return bytes;
}

/// Places and variances are those of the version's tags. Correlations of unusable tags are ignored.
Expected<KnownMap> known_from(const std::vector<std::byte>& bytes, const TagMap& map,
                              const std::string& context) {
  LittleEndianReader reader(bytes);
  KnownMap known;
  known.revision = 1;
  const std::uint32_t tags = reader.u32();
  for (std::uint32_t i = 0; i < tags && !reader.failed(); ++i) {
    const MapTag* entry = map.find(reader.i32());
    if (entry != nullptr && entry->is_usable()) known.tags.push_back(entry->tag);
  }
  const std::uint32_t pairs = reader.u32();
  for (std::uint32_t i = 0; i < pairs && !reader.failed(); ++i) {
    KnownPair pair;
    pair.first_id = reader.i32();
    pair.second_id = reader.i32();
    for (int row = 0; row < 6; ++row)
      for (int column = 0; column < 6; ++column) pair.covariance(row, column) = reader.f64();
    if (!pair.covariance.allFinite()) return fail(ErrorCode::kInvalid, "is damaged", context);
    known.pairs.push_back(pair);
  }
  const std::uint32_t wrong = reader.left() > 0 ? reader.u32() : 0;
  for (std::uint32_t i = 0; i < wrong && !reader.failed(); ++i)
    known.wrong_prints.push_back(reader.i32());
  if (auto whole = reader.check(context); !whole) return tl::unexpected(whole.error());
  const auto ids = [](const KnownPair& pair) { return std::pair(pair.first_id, pair.second_id); };
  if (!std::is_sorted(known.tags.begin(), known.tags.end(),
                      [](const auto& a, const auto& b) { return a.tag_id < b.tag_id; }) ||
      !std::is_sorted(known.pairs.begin(), known.pairs.end(),
                      [&](const auto& a, const auto& b) { return ids(a) < ids(b); }))
    return fail(ErrorCode::kInvalid, "is damaged: ties must be sorted", context);
  return known;
}

}  // namespace

Expected<void> create_ties(SqliteFile& file) { return file.execute(kCreateTies); }

Expected<void> insert_ties(const SqliteFile& file, const TagMap& map) {
  if (!map.known || map.known->pairs.empty()) return {};
  const std::vector<std::byte> bytes = bytes_of(*map.known);
  auto insert = file.prepare("INSERT INTO tie VALUES (?,?,?)");
  return insert.bind(map.version).bind(hash_of(bytes)).bind(bytes).run();
}

Expected<void> load_ties(const SqliteFile& file, TagMap& map, const std::string& context) {
  const auto tables = file.integer("SELECT count(*) FROM sqlite_master WHERE name = 'tie'");
  if (!tables) return tl::unexpected(tables.error());
  if (*tables == 0) return {};
  auto row = file.prepare("SELECT hash, content FROM tie WHERE version = ?");
  const auto found = row.bind(map.version).step();
  if (!found) return tl::unexpected(found.error());
  if (!*found) return {};
  const std::vector<std::byte> bytes = row.blob(1);
  if (const auto hash = hash_of(bytes); hash != row.text(0))
    return fail(ErrorCode::kInvalid,
                "is damaged: its ties have hash " + hash + ", stored was " + row.text(0) +
                    "; go back to another version",
                context);
  auto known = known_from(bytes, map, context);
  if (!known) return tl::unexpected(known.error());
  map.known = std::make_shared<const KnownMap>(std::move(*known));
  return {};
}

Expected<void> remove_ties(const SqliteFile& file, std::int64_t version) {
  auto statement = file.prepare("DELETE FROM tie WHERE version = ?");
  return statement.bind(version).run();
}

Expected<void> remove_old_ties(const SqliteFile& file, std::int64_t newest,
                               const std::string& automatic_comment) {
  auto statement = file.prepare(
      "DELETE FROM tie WHERE version < ? AND version IN "
      "(SELECT version FROM version WHERE comment = ?)");
  return statement.bind(newest).bind(automatic_comment).run();
}

}  // namespace fiducap
