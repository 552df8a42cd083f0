#include "mapping/store/sqlite_file.hpp"

#include <sqlite3.h>

#include <algorithm>
#include <utility>

namespace fiducap {

namespace {

constexpr int kBusyTimeout_ms = 500;
constexpr int kLongestValue_bytes = 64 << 20;

Error error_of(int code, const std::string& detail, const std::string& path) {
  switch (code & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return {ErrorCode::kUnavailable,
              "another process is writing to it; stop that one or try again", path};
    case SQLITE_FULL:
      return {ErrorCode::kUnavailable,
              "the disk is full; nothing was stored, free some space and try again", path};
    case SQLITE_READONLY:
      return {ErrorCode::kUnavailable, "is read-only; nothing was stored", path};
    case SQLITE_CANTOPEN:
      return {ErrorCode::kUnavailable, "cannot be opened; the folder must exist and be writable",
              path};
    case SQLITE_IOERR:
      return {ErrorCode::kUnavailable, "the disk failed (" + detail + "); nothing was stored",
              path};
    case SQLITE_NOMEM:
    case SQLITE_INTERRUPT:
      return {ErrorCode::kUnavailable, "there was no memory for it (" + detail + "); try again",
              path};
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
      return {ErrorCode::kInvalid,
              "is damaged or not a map store (" + detail +
                  "); it was not changed: `fiducap map repair` saves its readable part; or restore "
                  "a copy of it, or move it away",
              path};
    default:
      return {ErrorCode::kInvalid, "SQLite reports: " + detail, path};
  }
}

/// @return the first error of the disk when all bytes of the file are read
int read_whole(sqlite3_file* file) {
  constexpr sqlite3_int64 kAtOnce = 4096;
  sqlite3_int64 bytes = 0;
  if (file == nullptr || file->pMethods == nullptr) return SQLITE_OK;
  int code = file->pMethods->xFileSize(file, &bytes);
  std::array<char, kAtOnce> part{};
  for (sqlite3_int64 at = 0; at < bytes && code == SQLITE_OK; at += kAtOnce) {
    code = file->pMethods->xRead(file, part.data(), static_cast<int>(kAtOnce), at);
    if (code == SQLITE_IOERR_SHORT_READ) code = SQLITE_OK;
  }
  return code;
}

}  // namespace

// --- SqliteStatement ---

void SqliteStatement::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

SqliteStatement::SqliteStatement(sqlite3* file, std::string path, std::string_view sql)
    : file_(file), path_(std::move(path)) {
  sqlite3_stmt* statement = nullptr;
  keep(sqlite3_prepare_v2(file_, sql.data(), static_cast<int>(sql.size()), &statement, nullptr));
  statement_.reset(statement);
}

void SqliteStatement::keep(int code) {
  if (failure_ != SQLITE_OK || code == SQLITE_OK) return;
  failure_ = code;
  error_ = error_of(code, sqlite3_errmsg(file_), path_);
}

SqliteStatement& SqliteStatement::bind(std::int64_t value) {
  if (failure_ == SQLITE_OK) keep(sqlite3_bind_int64(statement_.get(), ++bound_, value));
  return *this;
}

SqliteStatement& SqliteStatement::bind(double value) {
  if (failure_ == SQLITE_OK) keep(sqlite3_bind_double(statement_.get(), ++bound_, value));
  return *this;
}

SqliteStatement& SqliteStatement::bind(const std::string& value) {
  if (failure_ != SQLITE_OK) return *this;
  keep(sqlite3_bind_text64(statement_.get(), ++bound_, value.data(), value.size(), SQLITE_TRANSIENT,
                           SQLITE_UTF8));
  return *this;
}

SqliteStatement& SqliteStatement::bind(std::span<const std::byte> value) {
  if (failure_ != SQLITE_OK) return *this;
  keep(sqlite3_bind_blob64(statement_.get(), ++bound_, value.data(), value.size(),
                           SQLITE_TRANSIENT));
  return *this;
}

SqliteStatement& SqliteStatement::bind_null() {
  if (failure_ == SQLITE_OK) keep(sqlite3_bind_null(statement_.get(), ++bound_));
  return *this;
}

Expected<bool> SqliteStatement::step() {
  if (failure_ == SQLITE_OK) {
    const int code = sqlite3_step(statement_.get());
    if (code == SQLITE_ROW) return true;
    if (code == SQLITE_DONE) return false;
    keep(code);
  }
  return tl::unexpected<Error>(error_);
}

Expected<void> SqliteStatement::run() {
  if (auto stepped = step(); !stepped) return tl::unexpected<Error>(stepped.error());
  sqlite3_reset(statement_.get());
  bound_ = 0;
  return {};
}

bool SqliteStatement::is_null(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

std::int64_t SqliteStatement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double SqliteStatement::real(int column) const {
  return sqlite3_column_double(statement_.get(), column);
}

std::string SqliteStatement::text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  if (text == nullptr) return {};
  return {text, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

std::vector<std::byte> SqliteStatement::blob(int column) const {
  const auto* bytes = static_cast<const std::byte*>(sqlite3_column_blob(statement_.get(), column));
  if (bytes == nullptr) return {};
  return {bytes, bytes + sqlite3_column_bytes(statement_.get(), column)};
}

// --- SqliteFile ---

void SqliteFile::Close::operator()(sqlite3* file) const { sqlite3_close_v2(file); }

Expected<SqliteFile> SqliteFile::open(const std::string& path, Access access) {
  if (path.empty()) return fail(ErrorCode::kInvalid, "the map store needs a path");
  SqliteFile opened;
  opened.path_ = path;
  sqlite3* file = nullptr;
  const int create = access == Access::kWrite ? SQLITE_OPEN_CREATE : 0;
  const int code = sqlite3_open_v2(path.c_str(), &file, SQLITE_OPEN_READWRITE | create, nullptr);
  opened.file_.reset(file);
  if (code != SQLITE_OK) return tl::unexpected<Error>(error_of(code, sqlite3_errstr(code), path));
  sqlite3_extended_result_codes(file, 1);
  sqlite3_busy_timeout(file, kBusyTimeout_ms);
  // The file may come from anyone: functions are not run for what it defines.
  sqlite3_db_config(file, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(file, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(file, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_limit(file, SQLITE_LIMIT_LENGTH, kLongestValue_bytes);
  if (access == Access::kSalvage) {
    opened.write_back_on_close(false);
    // writable_schema: reads a file that is shorter than its header claims, too.
    for (const char* pragma :
         {"PRAGMA cell_size_check = ON", "PRAGMA writable_schema = ON", "PRAGMA query_only = ON"}) {
      if (auto set = opened.execute(pragma); !set) return tl::unexpected<Error>(set.error());
    }
  }
  return opened;
}

Expected<void> SqliteFile::execute(const char* sql) {
  const int code = sqlite3_exec(file_.get(), sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK)
    return tl::unexpected<Error>(error_of(code, sqlite3_errmsg(file_.get()), path_));
  return {};
}

Expected<void> SqliteFile::transaction(const std::function<Expected<void>()>& work) {
  // Also when `work` throws. Fails only when SQLite has rolled back already.
  struct Rollback {
    SqliteFile* file;
    ~Rollback() {
      if (file != nullptr) (void)file->execute("ROLLBACK");
    }
  };
  if (auto begun = execute("BEGIN IMMEDIATE"); !begun) return begun;
  Rollback rollback{this};
  auto done = work().and_then([this] { return execute("COMMIT"); });
  if (done) rollback.file = nullptr;
  return done;
}

Expected<std::int64_t> SqliteFile::integer(std::string_view sql) const {
  auto query = prepare(sql);
  return query.step().map([&query](bool row) { return row ? query.integer(0) : 0; });
}

Expected<std::string> SqliteFile::text(std::string_view sql) const {
  auto query = prepare(sql);
  return query.step().map([&query](bool row) { return row ? query.text(0) : std::string{}; });
}

Expected<std::string> SqliteFile::definition() const {
  // Automatic indices have no text.
  auto plain = text(
      "SELECT coalesce(min(type || ' ' || name), '') FROM sqlite_master "
      "WHERE type NOT IN ('table', 'index') OR rootpage = 0");
  if (!plain || !plain->empty()) return plain;
  return text(
      "SELECT coalesce(min('generated column ' || t.name || '.' || c.name), '') "
      "FROM sqlite_master AS t JOIN pragma_table_xinfo(t.name) AS c "
      "WHERE t.type = 'table' AND c.hidden <> 0");
}

Expected<void> SqliteFile::copy_to(SqliteFile& other) const {
  constexpr int kAllPages = -1;
  sqlite3_backup* const copying =
      sqlite3_backup_init(other.file_.get(), "main", file_.get(), "main");
  if (copying == nullptr)
    return tl::unexpected<Error>(error_of(sqlite3_errcode(other.file_.get()),
                                          sqlite3_errmsg(other.file_.get()), other.path_));
  const int step = sqlite3_backup_step(copying, kAllPages);
  const int end = sqlite3_backup_finish(copying);
  if (step == SQLITE_DONE && end == SQLITE_OK) return {};
  const int code = step == SQLITE_DONE ? end : step;
  return tl::unexpected<Error>(error_of(code, sqlite3_errstr(code), other.path_));
}

/// SQLite's check reports unreadable parts of the disk as faults of the file.
Expected<std::string> SqliteFile::structural_fault() const {
  auto verdict = text("PRAGMA quick_check(1)");
  if (!verdict || *verdict == "ok") return verdict.map([](const auto&) { return std::string{}; });
  for (const int which : {SQLITE_FCNTL_FILE_POINTER, SQLITE_FCNTL_JOURNAL_POINTER}) {
    sqlite3_file* disk = nullptr;
    sqlite3_file_control(file_.get(), "main", which, static_cast<void*>(&disk));
    if (const int code = read_whole(disk); code != SQLITE_OK)
      return tl::unexpected<Error>(error_of(code, sqlite3_errstr(code), path_));
  }
  // The disk is readable, at least now.
  verdict = text("PRAGMA quick_check(1)");
  if (!verdict || *verdict == "ok") return verdict.map([](const auto&) { return std::string{}; });
  std::replace(verdict->begin(), verdict->end(), '\n', ' ');
  return verdict;
}

void SqliteFile::write_back_on_close(bool allowed) {
  sqlite3_db_config(file_.get(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, allowed ? 0 : 1, nullptr);
}

Expected<SqliteShape> SqliteFile::shape() const {
  sqlite3_file* disk = nullptr;
  sqlite3_vfs* system = nullptr;
  sqlite3_file_control(file_.get(), "main", SQLITE_FCNTL_FILE_POINTER, &disk);
  sqlite3_file_control(file_.get(), "main", SQLITE_FCNTL_VFS_POINTER, &system);
  if (disk == nullptr || disk->pMethods == nullptr || system == nullptr) return SqliteShape{};
  SqliteShape shape;
  sqlite3_int64 bytes = 0;
  int code = disk->pMethods->xFileSize(disk, &bytes);
  shape.bytes = bytes;
  if (code == SQLITE_OK) {
    code = disk->pMethods->xRead(disk, shape.head.data(), static_cast<int>(shape.head.size()), 0);
    if (code == SQLITE_IOERR_SHORT_READ) code = SQLITE_OK;
  }
  for (const char* end : {"-wal", "-journal"}) {
    int there = 0;
    if (code == SQLITE_OK)
      code = system->xAccess(system, (path_ + end).c_str(), SQLITE_ACCESS_EXISTS, &there);
    shape.has_log = shape.has_log || there != 0;
  }
  if (code != SQLITE_OK) return tl::unexpected<Error>(error_of(code, sqlite3_errstr(code), path_));
  return shape;
}

}  // namespace fiducap
