#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace fiducap {

/// One SQL statement with its values. Bind all parameters in order, then `step`; the first failure
/// is kept and reported by `step`. Must not outlive its file.
class SqliteStatement final {
 public:
  SqliteStatement& bind(std::int64_t value);
  SqliteStatement& bind(double value);
  SqliteStatement& bind(const std::string& value);
  SqliteStatement& bind(std::span<const std::byte> value);
  SqliteStatement& bind_null();
  /// @return true when a row is there, false at the end.
  [[nodiscard]] Expected<bool> step();
  /// Calls `read` at each row.
  template <typename Read>
  [[nodiscard]] Expected<void> each_row(Read read) {
    for (auto row = step();; row = step()) {
      if (!row) return tl::unexpected(row.error());
      if (!*row) return {};
      read();
    }
  }
  /// Runs a statement without rows and prepares it for the next values.
  [[nodiscard]] Expected<void> run();

  [[nodiscard]] bool is_null(int column) const;
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] double real(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] std::vector<std::byte> blob(int column) const;

 private:
  friend class SqliteFile;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  SqliteStatement(sqlite3* file, std::string path, std::string_view sql);
  void keep(int code);

  sqlite3* file_;
  std::string path_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  int bound_{0};
  int failure_{0};
  Error error_;
};

/// The file on the disk, without the logs beside it: SQLite accepts damages of it silently, as an
/// empty or a shorter database.
struct SqliteShape {
  std::int64_t bytes{};
  std::array<unsigned char, 18> head{};  ///< With zeros behind the end.
  bool has_log{};                        ///< A write-ahead log or a rollback journal is there.
};

/// One open SQLite file. Every Error contains what to do about it; nothing throws.
class SqliteFile final {
 public:
  enum class Access {
    kWrite,   ///< Opens or creates.
    kSalvage  ///< Of a file that may be damaged: reads what can be read, changes nothing.
  };
  /// Waits at most half a second for another process's lock.
  [[nodiscard]] static Expected<SqliteFile> open(const std::string& path,
                                                 Access access = Access::kWrite);

  [[nodiscard]] Expected<void> execute(const char* sql);
  /// Commits what `work` does; rolls back when it fails. Takes the write lock at once.
  [[nodiscard]] Expected<void> transaction(const std::function<Expected<void>()>& work);
  [[nodiscard]] SqliteStatement prepare(std::string_view sql) const {
    return {file_.get(), path_, sql};
  }
  /// The one value of a query such as a PRAGMA.
  [[nodiscard]] Expected<std::int64_t> integer(std::string_view sql) const;
  [[nodiscard]] Expected<std::string> text(std::string_view sql) const;
  /// @return a view, trigger, virtual table or generated column, by name; empty: there are plain
  /// tables only
  [[nodiscard]] Expected<std::string> definition() const;
  /// Replaces the content of `other` by this one's at one instant; other processes may write to
  /// this file meanwhile.
  [[nodiscard]] Expected<void> copy_to(SqliteFile& other) const;
  /// @return what is wrong with its structure, in one line; empty: nothing
  [[nodiscard]] Expected<std::string> structural_fault() const;
  /// False: closing writes nothing, so that a foreign file stays as it is.
  void write_back_on_close(bool allowed);
  /// To be called before any other access, which may initialise the file.
  [[nodiscard]] Expected<SqliteShape> shape() const;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  struct Close {
    void operator()(sqlite3* file) const;
  };
  SqliteFile() = default;

  std::unique_ptr<sqlite3, Close> file_;
  std::string path_;
};

}  // namespace fiducap
